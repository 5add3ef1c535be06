"""Bodies and their poses for `known_motion.py`; nothing of the tracker takes part.

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
        result["knee_flexion" + side] = 180 - corner(at["hip" + side], at["knee" + side], at["ankle" + side])
        result["hip_flexion" + side] = np.degrees(np.arctan2(-thigh[:, 1], -thigh[:, 2]))
        result["ankle" + side] = 90 - corner(at["knee" + side], at["ankle" + side], at["toe" + side])
        result["elbow" + side] = 180 - corner(at["shoulder" + side], at["elbow" + side], at["wrist" + side])
    return {n + s: result[n + s] for n in ("knee_flexion", "hip_flexion", "ankle", "elbow") for s in ("_l", "_r")}


def corner(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the angle at b, in degrees."""
    one, other = a - b, c - b
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), (one * other).sum(-1)))


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
