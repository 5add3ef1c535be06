"""Scripted motions for `known_motion.py`: joint rotations at given times; `known_poses.ground` puts them on a floor."""

from __future__ import annotations

import numpy as np
from known_poses import Body, corner
from scipy.spatial.transform import Rotation

HAND, FOOT = 0.29, 0.22  # m, from wrist and ankle to the floor in a push-up, about


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


def run(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of running on the spot, 2.5 steps a second."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    step = np.sin(2 * np.pi * t / 0.8)
    turn["pelvis"] = np.stack([0.1 + 0 * t, 0.04 * step, 0.12 * step], axis=1)
    turn["spine"] = np.stack([0.05 + 0 * t, -0.04 * step, -0.12 * step], axis=1)
    turn["chest"] = np.outer(step, [0, 0, -0.12])
    for side, sign in (("_l", 1), ("_r", -1)):
        lift, late = np.clip(sign * step, 0, 1), np.clip(sign * np.sin(2 * np.pi * t / 0.8 + 0.9), 0, 1)
        turn["hip" + side] = np.stack([-0.15 - 0.85 * lift, 0 * t, sign * 0.04 * lift], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = 0.3 + 1.3 * late, -0.1 + 0.35 * late
        ways = [[sign * 0.3, 0.7 * sign * s, -1] for s in step]
        turn["shoulder" + side] = _reach(body, side, ways)
        turn["elbow" + side] = np.stack([-0.4 + 0 * t, 0 * t, sign * (1.0 + 0.3 * step * sign)], axis=1)
    return turn


def jack(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of legs and arms apart and back, as in jumping jacks, on the floor."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    apart = (1 - np.cos(2 * np.pi * t / 1.1)) / 2
    turn["pelvis"], turn["spine"] = np.outer(apart, [0.05, 0, 0]), np.outer(apart, [-0.08, 0, 0])
    for side, sign in (("_l", 1), ("_r", -1)):
        turn["hip" + side] = np.stack([-0.1 - 0.2 * apart * (1 - apart), -sign * (0.02 + 0.38 * apart), 0 * t], axis=1)
        turn["knee" + side][:, 0] = 0.15 + 1.2 * apart * (1 - apart)
        turn["ankle" + side] = np.stack([-0.05 - 0.8 * apart * (1 - apart), sign * 0.3 * apart, 0 * t], axis=1)
        turn["shoulder" + side] = _reach(
            body, side, [[sign * (0.25 + 1.2 * a * (1.2 - a)), -0.15, 2.0 * a - 1] for a in apart]
        )
        turn["elbow" + side] = np.outer(apart * (1 - apart), [-1.2, 0, 0]) + [-0.15, 0, 0]
    return turn


def kneel(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of going down on the right knee and getting up again."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    down = np.sin(np.pi * t / t[-1]) ** 2
    turn["pelvis"] = np.stack([0.04 + 0.3 * down * (1 - down), 0 * t, 0.12 * down], axis=1)
    turn["spine"], turn["chest"] = np.outer(down, [0.08, 0, -0.03]), np.outer(down, [0.03, 0, -0.03])
    turn["hip_l"] = np.stack([-0.15 - 1.35 * down, -0.05 * down, 0.05 * down], axis=1)
    turn["knee_l"][:, 0], turn["ankle_l"][:, 0] = 0.22 + 1.35 * down, -0.07
    turn["hip_r"] = np.stack([-0.15 + 0.2 * down - 0.6 * down * (1 - down), 0.05 * down, 0 * t], axis=1)
    turn["knee_r"][:, 0], turn["ankle_r"][:, 0] = 0.22 + 1.4 * down, -0.07 + 0.9 * down
    for side, sign in (("_l", 1), ("_r", -1)):
        turn["shoulder" + side] = _reach(body, side, [[sign * (0.4 + 0.1 * d), -0.1 - 0.5 * d, -1] for d in down])
        turn["elbow" + side][:, 0] = -0.3 - 0.5 * down
    return turn


def plie(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of bending knees that point outward; the arms fold before the chest."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    down, fold = (1 - np.cos(2 * np.pi * t / 1.6)) / 2, (1 - np.cos(2 * np.pi * t / 2.3)) / 2
    turn["pelvis"], turn["spine"] = np.outer(down, [0.08, 0, 0]), np.outer(np.sin(2 * np.pi * t / 2.3), [0, 0.05, 0.1])
    for side, sign in (("_l", 1), ("_r", -1)):
        out, flex = 0.45 + 0.4 * down, 0.12 + 0.9 * down
        legs = Rotation.from_euler("ZX", np.stack([sign * out, -flex - 0.08 * down], axis=1))
        turn["hip" + side], turn["knee" + side][:, 0] = legs.as_rotvec(), flex
        turn["ankle" + side][:, 0] = -0.05 * down
        at_side, folded = (
            [[sign * 0.4, -0.1, -1], [sign * 0.2, -0.6, -1]],
            [[sign * 0.3, -0.55, -0.8], [-sign, -0.4, 0.1]],
        )
        ways = np.multiply.outer(1 - fold, at_side) + np.multiply.outer(fold, folded)
        turn["shoulder" + side], turn["elbow" + side] = _bent_over_time(body, side, ways)
    return turn


def grapevine(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of legs that cross, one before and one behind; arms swing across."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    wave = np.sin(2 * np.pi * t / 1.4)
    turn["pelvis"] = np.outer(wave, [0, 0.03, -0.3]) + [0.05, 0, 0]
    turn["spine"] = turn["chest"] = np.outer(wave, [0, -0.015, 0.15])  # a back shares its twist
    before, behind = np.clip(wave, 0, 1), np.clip(-wave, 0, 1)
    for side, sign, lift, fore in (("_l", 1, before, 1), ("_r", -1, behind, -1)):
        lean, knee = (-0.55 * lift, 0.7 * lift) if fore > 0 else (0.1 * lift, 0.75 * lift)
        turn["hip" + side] = np.stack([lean - 0.12, sign * (0.55 * lift - 0.08), 0 * t], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = 0.22 + knee, -0.1 + 0.2 * lift
        ways = [[0.9 * w + sign * 0.35, -0.7, -1 + 0.5 * abs(w)] for w in wave]
        turn["shoulder" + side], turn["elbow" + side][:, 0] = _reach(body, side, ways), -0.4
    return turn


def sit(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of sitting down as on a chair and rising; the hands go to the knees."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    down = np.sin(np.pi * t / t[-1]) ** 2
    lean = 0.04 + 0.5 * np.sin(2 * np.pi * t / t[-1]) ** 2 + 0.15 * down
    turn["pelvis"], turn["spine"], turn["chest"] = (np.outer(lean * part, [1, 0, 0]) for part in (0.7, 0.15, 0.15))
    for side, sign in (("_l", 1), ("_r", -1)):
        knee = 0.15 + 1.5 * down
        hip = -0.06 - 1.4 * down - 0.7 * lean
        turn["hip" + side] = np.stack([hip, -sign * 0.08 * down, 0 * t], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = knee, -hip - knee - 0.7 * lean
        ways = [[[sign * 0.2, -0.15 - 0.5 * d, -1], [0.05 * sign, -0.6 - 0.6 * d, -1 + 0.4 * d]] for d in down]
        turn["shoulder" + side], turn["elbow" + side] = _bent_over_time(body, side, ways)
    return turn


def akimbo(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of hands on the hips while the weight circles and a foot taps ahead."""
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    side_to_side, to_and_fro = np.sin(2 * np.pi * t / 1.5), np.cos(2 * np.pi * t / 1.5)
    turn["pelvis"] = np.stack([0.03 + 0.08 * to_and_fro, 0.08 * side_to_side, 0.15 * side_to_side], axis=1)
    turn["spine"] = turn["chest"] = -0.5 * turn["pelvis"] + [0.02, 0, 0]
    for side, sign in (("_l", 1), ("_r", -1)):
        tap = np.clip(sign * np.sin(2 * np.pi * t / 1.1), 0, 1) ** 1.5
        hip, knee = -0.1 - 0.08 * to_and_fro - 0.45 * tap, 0.15 + 0.25 * tap
        turn["hip" + side] = np.stack([hip, -sign * 0.1 - 0.08 * side_to_side, sign * 0.1 * tap], axis=1)
        turn["knee" + side][:, 0], turn["ankle" + side][:, 0] = knee, -0.05 - 0.2 * tap
        ways = [[[sign * 0.75, 0.3 + 0.1 * s, -0.7], [-sign * 0.5, -0.35, -0.75]] for s in side_to_side]
        turn["shoulder" + side], turn["elbow" + side] = _bent_over_time(body, side, ways)
    return turn


def scissors(body: Body, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotation vectors (T,3) per joint of legs that change places, one before the other behind, as scissors do.

    Arms go against them; the trunk stays upright. Every 0.6 s a leg from behind is before, its knee bent on the way.
    """
    turn = {name: np.zeros((len(t), 3)) for name in body.names}
    apart = np.sin(np.pi * t / 0.6)
    passing = np.cos(np.pi * t / 0.6)  # positive while the left leg comes forward
    turn["pelvis"] = np.stack([0.04 + 0 * t, 0.02 * passing, 0.08 * apart], axis=1)
    turn["spine"], turn["chest"] = np.outer(apart, [0, 0, -0.07]), np.outer(apart, [0, 0, -0.08])
    for side, sign in (("_l", 1), ("_r", -1)):
        lift = np.clip(sign * passing, 0, 1) ** 2
        turn["hip" + side] = np.stack([-0.08 - sign * 0.5 * apart - 0.35 * lift, -sign * 0.04 + 0 * t, 0 * t], axis=1)
        turn["knee" + side][:, 0] = 0.22 + 0.75 * lift
        turn["ankle" + side][:, 0] = -0.12 + 0.3 * sign * apart
        turn["shoulder" + side] = _reach(body, side, [[sign * 0.25, sign * 0.8 * a, -1] for a in apart])
        turn["elbow" + side] = np.stack([-0.25 + 0 * t, 0 * t, sign * (0.45 - 0.15 * sign * apart)], axis=1)
    return turn


SCRIPTS = {
    "squat": squat,
    "dance": dance,
    "lunge": lunge,
    "spin": spin,
    "push_up": push_up,
    "swing": swing,
    "bow": bow,
    "run": run,
    "jack": jack,
    "kneel": kneel,
    "plie": plie,
    "grapevine": grapevine,
    "sit": sit,
    "akimbo": akimbo,
    "scissors": scissors,
}


def _bent_over_time(body: Body, side: str, ways: np.ndarray | list) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation vectors (T,3) of shoulder and elbow by which upper arm and forearm point these ways (T,2,3)."""
    unit = np.array(ways) / np.linalg.norm(ways, axis=-1, keepdims=True)
    shoulder, elbow = np.moveaxis(np.array([_bent(body, side, way) for way in unit]), 1, 0)
    return shoulder, elbow


def _bent(body: Body, side: str, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation vectors (3) of shoulder and elbow by which upper arm and forearm point these ways (2,3)."""
    arm, forearm = np.diff([body.joint(name + side) for name in ("shoulder", "elbow", "wrist")], axis=0)
    axis = np.cross(arm, [0, -1, 0]) / np.linalg.norm(arm[[0, 2]])  # the forearm bends forward
    both = [ways[0], np.cross(*ways) / np.linalg.norm(np.cross(*ways))]
    shoulder = Rotation.align_vectors(both, [arm / np.linalg.norm(arm), axis])[0].as_rotvec()
    bend = corner(ways[0], np.zeros(3), ways[1]) - corner(arm, np.zeros(3), forearm)  # beyond that at rest
    return shoulder, axis * np.radians(bend)


def _reach(body: Body, side: str, towards: list[list[float]]) -> np.ndarray:
    """Return rotation vectors (T,3) of a shoulder that point the upper arm these ways."""
    arm = body.joint("elbow" + side) - body.joint("shoulder" + side)
    return np.stack([Rotation.align_vectors([way], [arm])[0].as_rotvec() for way in towards])
