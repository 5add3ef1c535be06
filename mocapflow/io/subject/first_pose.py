"""init.json: the pose of the first frame, as somebody wrote it down."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry import twists
from mocapflow.geometry.joints import angles_from_rotations
from mocapflow.io.cameras.calibration import FARTHEST
from mocapflow.io.findings import Finding, error, warning
from mocapflow.io.json_toml import place, read_json
from mocapflow.records import F64, array, record

FILE = "init.json"  # in the folder of the recording
ROOT = ("root_rotation", "root_translation")
TURNS = "joint_rotations"
FORM = (
    'expected {"root_rotation": [3], "root_translation": [3] (m, the root joint in the world), '
    '"joint_rotations": {name: [3]}}, rotation vectors in radians, relative to the parent'
)

HIGHEST = 10.0  # m above the floor; a root joint that is higher is in other units
MILLIMETRES = 500.0  # m from the origin; beyond, in millimetres, below, in centimetres
HALF_TURN = 1.1 * math.pi  # rad; a rotation vector needs no more than pi, and one in degrees may be as short


@record
class FirstPose:
    """The pose in a file."""

    rotation: F64 = array(3, unit="rad, rotation vector of the root joint in the world")
    position: F64 = array(3, unit="m, the root joint in the world")
    turns: Mapping[str, F64]  # of joints: rotation vectors (3,) rad, relative to the parent


def read_first_pose(path: Path, joints: Sequence[str]) -> FirstPose:
    """Read a first pose.

    Args:
        path: the file.
        joints: the names of the body's joints; empty: they are not compared.

    Raises:
        RecordingError: the file can't be read, or something in it is wrong; see `odd_pose`.
    """
    content = read_json(path, FORM)
    for odd in filter(lambda finding: finding.severity == "error", odd_pose(path, content, joints)):
        raise RecordingError(odd.message, where=odd.where, hint=odd.hint)
    vectors = {key: np.array(vector, np.float64) for key, vector in _vectors(content).items()}
    rotation, position = (vectors.pop(key) for key in ROOT)
    return FirstPose(rotation=rotation, position=position, turns=vectors)


def read_pose(path: Path, body: Body) -> Pose:
    """Return the pose of a file; of a part of a body where the file may be that of the whole.

    Raises:
        RecordingError: it is malformed, in other units, or names a joint the body lacks.
    """
    found = read_first_pose(path, () if body.cut.any() else body.joint_names)
    turns = {name: turn for name, turn in found.turns.items() if name in body.joint_names}
    return Pose(root=root_at(body, found.rotation, found.position), angles=angles_from_rotations(body, turns))


def root_at(body: Body, rotation: F64, position: F64) -> F64:
    """Return world_from_body (4, 4) that turns by a rotation vector (3,) and puts the root joint at (3,) m."""
    root = twists.exp(np.append(rotation, np.zeros(3)))
    root[:3, 3] = position - root[:3, :3] @ body.positions[0]
    return root


def odd_pose(path: Path, content: Any, joints: Sequence[str]) -> Iterator[Finding]:
    """Yield what is wrong with the content of a file, and where: keys, joints, numbers, units."""
    if not isinstance(content, dict) or not isinstance(content.get(TURNS, {}), dict):
        yield error("not a first pose", FORM, path)
        return
    for key in sorted(content.keys() - {*ROOT, TURNS}):
        yield error(f"unknown key '{key}'", alternatives(key, (*ROOT, TURNS)), place(path, key))
    for key in ROOT:
        if key not in content:
            yield error(f"'{key}' is missing", FORM, path)
    for joint in content.get(TURNS, {}):
        if joints and joint not in joints:
            yield error(f"the body has no joint '{joint}'", alternatives(joint, joints), place(path, joint))
    for key, vector in _vectors(content).items():
        for odd in _odd_vector(key, vector):
            yield replace(odd, where=place(path, key))


def _vectors(content: dict[str, Any]) -> dict[str, Any]:
    turns: dict[str, Any] = content.get(TURNS, {})
    return {key: content[key] for key in ROOT if key in content} | turns


def _odd_vector(key: str, value: Any) -> Iterator[Finding]:
    """Yield what is wrong with a vector: lengths and turns that no person has are in other units."""
    try:
        vector = np.array(value, np.float64)
    except (ValueError, TypeError, OverflowError):  # the last of a whole number of hundreds of digits
        vector = np.empty(0)
    size = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not np.isfinite(size):
        yield error(f"'{key}' is {value!r}", "expected three finite numbers")
    elif key == "root_translation" and (size > FARTHEST or abs(vector[2]) > HIGHEST):
        unit = "mm" if size > MILLIMETRES else "cm"
        yield error(f"the root joint is {size:.0f} m from the origin: it looks like {unit}", "lengths are in metres")
    elif key != "root_translation" and size > 2 * math.pi:
        yield error(f"'{key}' turns by {size:.1f} rad, more than once around: it looks like degrees", FORM)
    elif key != "root_translation" and size > HALF_TURN:
        yield warning(f"'{key}' turns by {size:.1f} rad, more than half around: is it in degrees?", FORM)
