"""Joints at rest: bones, and the directions of the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.records import F64, I32

SEGMENTS = {  # the joints they begin and end at
    "thigh": ("hip", "knee"), "shank": ("knee", "ankle"), "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
}  # fmt: skip


class Skeleton(NamedTuple):
    """Joints at rest, parents first."""

    names: tuple[str, ...]
    parents: I32  # (J,), -1 for the root
    positions: F64  # (J, 3) m

    def bone(self, joint: int) -> F64:
        """Return the vector (3,) from a joint to its first child; a leaf goes on as the bone before it."""
        children = np.flatnonzero(self.parents == joint)
        if len(children):
            return np.asarray(self.positions[children[0]] - self.positions[joint])
        return self.bone_before(joint)

    def bone_before(self, joint: int) -> F64:
        """Return the vector (3,) from the parent of a joint to the joint."""
        parent = self.parents[joint]
        return np.asarray(self.positions[joint] - self.positions[parent]) if parent >= 0 else np.zeros(3)


def unsided(name: str) -> str:
    """Return the name of a joint without its side."""
    return name.removesuffix("_l").removesuffix("_r")


def skeleton_of(body: Body) -> Skeleton:
    """Return the skeleton of a body."""
    return Skeleton(body.joint_names, body.parents, body.positions)


def segment_lengths(body: Body) -> Mapping[str, float]:
    """Return the length (m) of each limb segment that a body has, by its name and side, as `thigh_l`."""
    at = dict(zip(body.joint_names, body.positions, strict=True))
    ends = {f"{name}_{side}": (f"{a}_{side}", f"{b}_{side}") for name, (a, b) in SEGMENTS.items() for side in "lr"}
    return {name: float(np.linalg.norm(at[a] - at[b])) for name, (a, b) in ends.items() if a in at and b in at}


def to_segment(points: F64, start: F64, end: F64) -> F64:
    """Return how far (N,) m points (N, 3) are from the line between two others (3,)."""
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1))


def body_directions(skeleton: Skeleton) -> F64:
    """Return forward, left and up of the body at rest as rows (3, 3): up is +z, left is from hip_r to hip_l.

    Without hips any pair of `_l` and `_r` joints tells left from right; without a pair left is +x.
    """
    across = np.array([1.0, 0.0, 0.0])
    for name in ("hip_l", "shoulder_l", *(name for name in skeleton.names if name.endswith("_l"))):
        other = name.removesuffix("_l") + "_r"
        if name in skeleton.names and other in skeleton.names:
            across = skeleton.positions[skeleton.names.index(name)] - skeleton.positions[skeleton.names.index(other)]
            break
    across = across * (1.0, 1.0, 0.0)
    left = across / np.linalg.norm(across)
    up = np.array([0.0, 0.0, 1.0])
    return np.stack([np.cross(left, up), left, up])
