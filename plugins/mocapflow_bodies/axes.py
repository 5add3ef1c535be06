"""The axes a joint can turn about, read off the skeleton at rest."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mocapflow.geometry.skeleton import Skeleton, body_directions
from mocapflow.records import F64

FORWARD, LEFT, UP = np.eye(3)  # in (forward, left, up)


def joint_axes(skeleton: Skeleton, joint: int) -> Mapping[str, F64]:
    """Return unit axes (3,) by name, in the world; those of a right joint mirror those of a left one.

    `left`, `forward`, `up` are the body's. For an arm: `along` its bone, `hinge` of the elbow (a positive turn
    brings the forearm forwards), `across` both; and `raise`, `sweep` of the shoulder, which with `along` lock only
    where the upper arm points back and up, or across the body and down.
    """
    right = skeleton.names[joint].endswith("_r")
    mirror = np.array([1.0, -1.0 if right else 1.0, 1.0])
    directions = body_directions(skeleton)
    bone = unit(directions @ skeleton.bone(joint) * mirror)
    upper = unit(directions @ skeleton.bone(_upper_arm(skeleton, joint)) * mirror)
    ahead = orthogonal(FORWARD, upper)
    outward = np.cross(ahead, upper)
    hinge = orthogonal(np.cross(upper, ahead), bone)
    axes = {
        "left": LEFT,
        "forward": FORWARD,
        "up": UP,
        "along": bone,
        "hinge": hinge,
        "across": np.cross(bone, hinge),
        "raise": (ahead - outward) / math.sqrt(2),
        "sweep": -(ahead + outward) / math.sqrt(2),
    }
    reflect = np.prod(mirror) * mirror  # an axis of rotation is a pseudo-vector
    return {name: (axis * reflect) @ directions for name, axis in axes.items()}


def rest_bend(skeleton: Skeleton, joint: int, axis: F64) -> float:
    """Return how far (rad) the limb is bent about an axis at rest, zero where both bones are in line."""
    before, after = (bone - (bone @ axis) * axis for bone in (skeleton.bone_before(joint), skeleton.bone(joint)))
    return float(np.arctan2(axis @ np.cross(before, after), before @ after))


def orthogonal(vector: F64, to: F64) -> F64:
    """Return the unit vector (3,) nearest to `vector` that is orthogonal to the unit vector `to`."""
    rest = vector - (vector @ to) * to
    if np.linalg.norm(rest) < 0.1:  # nearly parallel: any other direction, the same one for every body
        turned = np.roll(vector, 1)
        rest = turned - (turned @ to) * to
    return unit(rest)


def unit(vector: F64) -> F64:
    """Return a vector (3,) at length one, straight down if it has no length."""
    length = np.linalg.norm(vector)
    return np.asarray(vector / length) if length > 1e-9 else -UP


def _upper_arm(skeleton: Skeleton, joint: int) -> int:
    """Return the shoulder above a joint, or the parent of the joint if there is none."""
    above = joint
    while above >= 0 and not skeleton.names[above].startswith("shoulder"):
        above = int(skeleton.parents[above])
    return above if above >= 0 else max(int(skeleton.parents[joint]), 0)
