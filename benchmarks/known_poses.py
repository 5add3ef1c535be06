"""Bodies, their poses and scripted motions for `known_motion.py`; nothing of the tracker takes part.

Metres, z up, floor at 0. Rest pose: the body looks along -y, left is +x. A pose is the root's translation and for each
joint j a rotation vector relative to its parent: G_j = G_parent R_j, p_j = p_parent + G_parent (rest_j - rest_parent).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

RATE = 30.0  # frames a second
HAND, FOOT = 0.29, 0.22  # m, from wrist and ankle to the floor in a push-up, about


@dataclass(frozen=True)
class Body:
    """Rest mesh (V,3), faces (F,3), joints (J,3), parents (J) with -1 for the root, weights (V,J)."""

    vertices: np.ndarray
    faces: np.ndarray
    names: list[str]
    joints: np.ndarray
    parents: list[int]
    weights: np.ndarray

    def main(self, *names: str) -> np.ndarray:
        """Return which vertices (V) follow one of these joints most; a name without side means both."""
        heads = np.array([name.removesuffix("_l").removesuffix("_r") for name in self.names])
        return np.isin(heads[self.weights.argmax(1)], names)

    def joint(self, name: str) -> np.ndarray:
        """Return the place (3) of a joint in the rest pose."""
        return self.joints[self.names.index(name)]


@dataclass(frozen=True)
class Motion:
    """Root translation (T,3) and rotation vectors (T,J,3), the root's first."""

    translation: np.ndarray
    rotations: np.ndarray


def read_body(folder: Path) -> Body:
    """Read body.obj, skeleton.json and weights.npz of a recording's subject."""
    lines = [line.split() for line in (folder / "body.obj").read_text().splitlines()]
    joints = json.loads((folder / "skeleton.json").read_text())["joints"]
    names, weights = [j["name"] for j in joints], np.load(folder / "weights.npz")
    return Body(
        np.array([x[1:4] for x in lines if x[:1] == ["v"]], float),
        np.array([[y.split("/")[0] for y in x[1:4]] for x in lines if x[:1] == ["f"]], int) - 1,
        names,
        np.array([j["position"] for j in joints], float),
        [names.index(j["parent"]) if j["parent"] else -1 for j in joints],
        weights["weights"][:, [list(weights["names"]).index(n) for n in names]].astype(float),
    )


# --- posing -----------------------------------------------------------------------------------------------------------


def chain(body: Body, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return turns (T,J,3,3) and positions (T,J,3) of the joints."""
    turns = Rotation.from_rotvec(motion.rotations.reshape(-1, 3)).as_matrix().reshape(*motion.rotations.shape, 3)
    places = np.empty(motion.rotations.shape)
    places[:, 0] = motion.translation
    for j, up in list(enumerate(body.parents))[1:]:
        turns[:, j] = turns[:, up] @ turns[:, j]
        places[:, j] = places[:, up] + turns[:, up] @ (body.joints[j] - body.joints[up])
    return turns, places


def skin(body: Body, motion: Motion, chosen: np.ndarray | slice = slice(None)) -> np.ndarray:
    """Return the chosen vertices (T,V,3) by linear blend skinning."""
    rest, weights = body.vertices[chosen], body.weights[chosen]
    result = []
    for turns, places in zip(*chain(body, motion), strict=True):
        shifts = places - np.einsum("jab,jb->ja", turns, body.joints)
        result.append(np.einsum("vj,jab,vb->va", weights, turns, rest, optimize=True) + weights @ shifts)
    return np.stack(result)


def angles(body: Body, positions: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of truth/angles.csv, each (T) in degrees, from joint centres (T,J,3)."""
    at = {name: positions[:, j] for j, name in enumerate(body.names)}
    fixed = [body.names.index(n) for n in ("hip_l", "hip_r", "spine")]  # they turn as the pelvis does
    rest = body.joints[fixed] - body.joints[0]
    pelvis = np.stack([Rotation.align_vectors(p[fixed] - p[0], rest)[0].as_matrix() for p in positions])
    result = {}
    for side in ("_l", "_r"):
        thigh = np.einsum("tba,tb->ta", pelvis, at["knee" + side] - at["hip" + side])
        result["knee_flexion" + side] = 180 - _corner(at["hip" + side], at["knee" + side], at["ankle" + side])
        result["hip_flexion" + side] = np.degrees(np.arctan2(-thigh[:, 1], -thigh[:, 2]))
        result["ankle" + side] = 90 - _corner(at["knee" + side], at["ankle" + side], at["toe" + side])
        result["elbow" + side] = 180 - _corner(at["shoulder" + side], at["elbow" + side], at["wrist" + side])
    return {n + s: result[n + s] for n in ("knee_flexion", "hip_flexion", "ankle", "elbow") for s in ("_l", "_r")}


def _corner(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the angle at b, in degrees."""
    one, other = a - b, c - b
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), (one * other).sum(-1)))


# --- motions ----------------------------------------------------------------------------------------------------------


def squat(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of squats with the arms forward at times (T) in s."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    knee, wave = np.radians(8 + 45 * (1 - np.cos(2 * np.pi * t / 1.5))), np.sin(2 * np.pi * t / 1.1)
    turn["pelvis"][:, 0], turn["spine"][:, 0], hip = 0.35 * knee, 0.05 * knee, 1.05 * knee
    for side, sign in (("_l", 1), ("_r", -1)):
        turn["hip" + side] = np.stack([-hip, 0 * t, sign * 0.12 * knee], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = knee, hip - knee - turn["pelvis"][:, 0]
        turn["shoulder" + side] = _reach(body, side, [[sign * 0.25, -1, 0.2 * w - 0.1] for w in wave])
        turn["elbow" + side][:, 0] = -0.15
    return turn


def dance(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of steps with a turn, twists of the trunk by 20 degrees, waving arms."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    step = np.sin(2 * np.pi * t / 1.1)
    turn["pelvis"] = np.stack([0.04 + 0 * t, 0.06 * step, np.radians(35) * (1 - np.cos(np.pi * t / t[-1]))], axis=1)
    turn["spine"][:, 2] = turn["chest"][:, 2] = np.radians(10) * np.sin(2 * np.pi * t / 1.3)
    for side, sign in (("_l", 1), ("_r", -1)):
        lift, up = np.clip(sign * step, 0, 1) ** 1.5, np.sin(2 * np.pi * t / 1.6 + sign)
        turn["hip" + side] = np.stack([-0.12 - 0.75 * lift, -0.06 * step, sign * 0.15 * lift], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = 0.22 + 1.1 * lift, -0.12 + 0.3 * lift
        turn["shoulder" + side] = _reach(body, side, [[sign, -0.4 - 0.3 * u, 0.2 + 0.6 * u] for u in up])
        turn["elbow" + side] = np.stack([-0.5 - 0.3 * up, 0 * t, sign * 0.3 * up], axis=1)
    return turn


def lunge(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of lunges with either leg by turns, the arms raised above the head."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    phase = np.sin(2 * np.pi * t / 2.4)
    deep = np.abs(phase) ** 1.5
    turn["pelvis"], turn["spine"] = np.outer(deep, [0.15, 0, 0]), np.outer(phase, [0, 0, 0.15])
    turn["chest"] = np.outer(phase, [0, 0, 0.15]) - np.outer(deep, [0.1, 0, 0])
    for side, sign in (("_l", 1), ("_r", -1)):
        ahead, behind = np.clip(sign * phase, 0, 1) ** 1.5, np.clip(-sign * phase, 0, 1) ** 1.5
        hip, knee = -0.05 - 1.2 * ahead + 0.2 * behind, 0.1 + 1.3 * ahead + 0.8 * behind
        turn["hip" + side] = np.stack([hip, 0 * t, sign * 0.1 * deep], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = knee, -hip - knee - turn["pelvis"][:, 0] + 0.7 * behind
        turn["shoulder" + side] = _reach(body, side, [[sign * (1 - 0.7 * d), -0.5, 1.6 * d - 0.8] for d in deep])
        turn["elbow" + side] = np.outer(1 - deep, [-0.7, 0, 0])
    return turn


def spin(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of one turn about the vertical in small steps, the arms spread."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    step, lean = np.sin(2 * np.pi * t / 0.8), np.sin(2 * np.pi * t / t[-1])
    turn["pelvis"][:, 2] = 2 * np.pi * (t / t[-1] - np.sin(2 * np.pi * t / t[-1]) / (2 * np.pi))
    turn["spine"] = np.stack([0.08 + 0 * t, 0.1 * lean, 0.12 * step], axis=1)
    for side, sign in (("_l", 1), ("_r", -1)):
        lift = np.clip(sign * step, 0, 1)
        turn["hip" + side] = np.stack([-0.1 - 0.45 * lift, 0 * t, sign * 0.1 * lift], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = 0.2 + 0.8 * lift, -0.1 + 0.2 * lift
        turn["shoulder" + side] = _reach(body, side, [[sign, -0.3 * sign * u, 0.1 + 0.4 * sign * u] for u in lean])
        turn["elbow" + side] = np.stack([-0.3 - 0.3 * lift, 0 * t, 0 * t], axis=1)
    return turn


def push_up(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of push-ups on upright forearms, a knee drawn up in between."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    deep, draw = (1 - np.cos(2 * np.pi * t / 1.6)) / 2, np.sin(np.pi * t / 1.6) ** 2
    aside = 0.25 + 0.8 * deep  # rad, of the upper arms from upright
    shoulder, elbow, wrist, ankle = (body.joint(name) for name in ("shoulder_l", "elbow_l", "wrist_l", "ankle_l"))
    height = np.linalg.norm(elbow - shoulder) * np.cos(aside) + np.linalg.norm(wrist - elbow) + HAND - FOOT
    turn["pelvis"][:, 0] = np.pi / 2 - np.arcsin(height / (shoulder - ankle)[2])
    for side, sign in (("_l", 1), ("_r", -1)):
        lift = np.clip(sign * np.sin(2 * np.pi * t / 3.2), 0, 1) * (1 - draw)
        turn["hip" + side][:, 0], turn["knee" + side][:, 0] = 0.05 - 0.9 * lift, 0.1 + 1.2 * lift
        upper = np.stack([sign * 0.8 * np.sin(aside), 0.6 * np.sin(aside), -np.cos(aside)], axis=1)
        ways = np.stack([upper, np.broadcast_to([0, 0, -1], upper.shape)], axis=1)  # in the world; the trunk leans
        leans = Rotation.from_rotvec(turn["pelvis"]).inv()
        bent = [_bent(body, side, back.apply(way)) for back, way in zip(leans, ways, strict=True)]
        turn["shoulder" + side], turn["elbow" + side] = np.moveaxis(np.array(bent), 1, 0)
    return turn


def swing(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of the left leg swinging forth and back, then the right one aside."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    wave, half = np.sin(2 * np.pi * t / 1.2), t[-1] / 2
    fore = wave * (1 - np.exp(-t / 0.3)) / (1 + np.exp((t - half) / 0.05))
    side = np.clip(np.sin(np.pi * (t - half) / half), 0, 1) ** 1.5
    turn["pelvis"] = np.stack([0.05 - 0.08 * fore, 0.08 * side, 0.1 * fore], axis=1)
    turn["spine"] = np.stack([0.03 + 0.05 * fore, -0.1 * side, -0.08 * fore], axis=1)
    turn["hip_l"] = np.stack([-0.1 - 0.65 * fore, -0.08 * side, 0 * t], axis=1)
    turn["knee_l"][:, 0], turn["ankle_l"][:, 0] = 0.15 + 0.45 * np.clip(-fore, 0, 1), 0.25 * np.abs(fore)
    turn["hip_r"], turn["knee_r"][:, 0] = np.stack([-0.08 + 0 * t, 0.85 * side, 0 * t], axis=1), 0.12
    for name, sign in (("_l", 1), ("_r", -1)):
        ways = [[sign * (0.3 + 0.8 * s), -0.2 + sign * 0.6 * f, -1] for s, f in zip(side, fore, strict=True)]
        turn["shoulder" + name], turn["elbow" + name][:, 0] = _reach(body, name, ways), -0.25
    return turn


def bow(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of bending down to the floor on soft knees, a step before and after."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    down = np.sin(np.pi * t / t[-1]) ** 2
    step = np.sin(2 * np.pi * t / 1.0) * (1 - down) ** 2
    turn["pelvis"] = np.stack([0.03 + 0.75 * down, 0.04 * step, 0.25 * down], axis=1)
    turn["spine"], turn["chest"] = np.outer(down, [0.30, 0, 0.05]), np.outer(down, [0.20, 0, 0.05])
    for side, sign in (("_l", 1), ("_r", -1)):
        lift = np.clip(sign * step, 0, 1)
        hip, knee = 0.1 + 0.5 * lift + (0.95 + 0.15 * sign) * down, 0.18 + 0.9 * lift + (0.45 + 0.2 * sign) * down
        turn["hip" + side] = np.stack([-hip, 0 * t, sign * 0.08 * down], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = knee, 0.9 * (hip - knee - turn["pelvis"][:, 0])
        ways = [[sign * (0.35 - 0.2 * d), -0.1 - 1.6 * d, -1 + 0.2 * d] for d in down]
        turn["shoulder" + side], turn["elbow" + side][:, 0] = _reach(body, side, ways), -0.3 + 0.15 * down
    return turn


SCRIPTS = {
    "squat": squat,
    "dance": dance,
    "lunge": lunge,
    "spin": spin,
    "push_up": push_up,
    "swing": swing,
    "bow": bow,
}


def _bent(body: Body, side: str, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation vectors (3) of shoulder and elbow by which upper arm and forearm point these ways (2,3)."""
    arm, forearm = np.diff([body.joint(name + side) for name in ("shoulder", "elbow", "wrist")], axis=0)
    axis = np.cross(arm, [0, -1, 0]) / np.linalg.norm(arm[[0, 2]])  # the forearm bends forward
    both = [ways[0], np.cross(*ways) / np.linalg.norm(np.cross(*ways))]
    shoulder = Rotation.align_vectors(both, [arm / np.linalg.norm(arm), axis])[0].as_rotvec()
    bend = _corner(ways[0], np.zeros(3), ways[1]) - _corner(arm, np.zeros(3), forearm)  # beyond that at rest
    return shoulder, axis * np.radians(bend)


def _reach(body: Body, side: str, towards: list[list[float]]) -> np.ndarray:
    """Return rotation vectors (T,3) of a shoulder that point the upper arm these ways."""
    arm = body.joint("elbow" + side) - body.joint("shoulder" + side)
    return np.stack([Rotation.align_vectors([way], [arm])[0].as_rotvec() for way in towards])


def ground(body: Body, rotations: np.ndarray, flight: tuple[int, int] | None = None) -> Motion:
    """Stand the body on the floor: the lower foot, at z = 0, stays where it is; steady travel is removed."""
    still = Motion(np.zeros((len(rotations), 3)), rotations)
    feet = [body.main("ankle", "toe") & (sign * body.vertices[:, 0] > 0) for sign in (1, -1)]
    soles = [skin(body, still, foot) for foot in feet]
    heights = np.stack([s[..., 2].min(1) for s in soles], axis=1)
    rests = np.exp((heights.min(1, keepdims=True) - heights) / 0.015)
    rests /= rests.sum(1, keepdims=True)
    moves = np.diff(np.stack([s[..., :2].mean(1) for s in soles], axis=1), axis=0)
    steps = -(moves * (rests[1:] + rests[:-1])[..., None] / 2).sum(1)
    z, t = gaussian_filter1d(-heights.min(1), 1.0, mode="nearest"), np.arange(len(rotations))
    if flight:
        steps[flight[0] : flight[1]] = 0.0
        z += np.maximum(0, 9.81 / 2 * (t - flight[0]) * (flight[1] - t)) / RATE**2
    path = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    path -= np.stack([np.polyval(np.polyfit(t, x, 1), t) for x in path.T], axis=1)
    return Motion(np.column_stack([gaussian_filter1d(path, 1.0, axis=0, mode="nearest"), z]), rotations)
