"""Skeletons: reading `skeleton.json`, and the directions of the body."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mocapflow.errors import RecordingError, alternatives
from mocapflow.records import F64, I32

FORM = 'expected {"joints": [{"name": "pelvis", "parent": null, "position": [x, y, z] in m}, …]}, parents first'


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


def read_skeleton(path: Path) -> Skeleton:
    """Read a skeleton.

    Raises:
        RecordingError: the file is missing, malformed, not parents first, has two roots or numbers that are not finite.
    """
    if not path.is_file():
        raise RecordingError(
            "there is no skeleton for the mesh", where=str(path),
            hint=f"{FORM}; or use `body: template` with the stage fit_subject",
        )  # fmt: skip
    try:
        return parse_skeleton(json.loads(path.read_text(encoding="utf-8")), str(path))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise RecordingError(f"this is not a skeleton: {error!r}", where=str(path), hint=FORM) from error


def parse_skeleton(content: Mapping[str, Any], where: str) -> Skeleton:
    """Return the skeleton that the content of a `skeleton.json` describes."""
    joints = content["joints"]
    names = [str(joint["name"]) for joint in joints]
    parents = []
    for row, joint in enumerate(joints):
        parent, earlier = joint["parent"], names[:row]
        if names[row] in earlier:
            raise RecordingError(f"joint '{names[row]}' is listed twice", where=where, hint=FORM)
        if parent is not None and parent not in earlier:
            hint = f"a parent stands before its children; {alternatives(str(parent), earlier)}"
            what = f"parent '{parent}' of joint '{names[row]}' is not listed before it"
            raise RecordingError(what, where=where, hint=hint)
        parents.append(-1 if parent is None else names.index(parent))
    positions = np.array([joint["position"] for joint in joints], np.float64).reshape(len(names), 3)
    if parents.count(-1) != 1 or not np.isfinite(positions).all():
        what = "positions are not all numbers" if not np.isfinite(positions).all() else "one joint must have no parent"
        raise RecordingError(what, where=where, hint=FORM)
    return Skeleton(tuple(names), np.array(parents, np.int32), positions)


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
