"""Stage `start_from_file`: the first pose as somebody wrote it down."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.components import Stage
from mocapflow.data import Pose, Start
from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry import twists
from mocapflow.geometry.joints import angles_from_rotations
from mocapflow.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
FORM = (
    'expected {"root_rotation": [3], "root_translation": [3] (m, the root joint in the world), '
    '"joint_rotations": {name: [3]}}, rotation vectors in radians, relative to the parent'
)


class StartFromFile(Stage):
    """Reads the pose of the first frame from `init.json` of the recording.

    A run or a part of one that begins at frame 1200 reads `init_001200.json`, if there is one.
    """

    name: ClassVar[str] = "start_from_file"
    file: str = "init.json"  # from the folder of the recording

    def inputs(self, recording: Path) -> Sequence[Path]:
        """Return the files that are read: their content is part of the cache key."""
        path = recording / self.file
        return [path, *sorted(recording.glob(f"{path.stem}_*{path.suffix}"))]

    def run(self, recording: Recording, scene: Scene) -> Start:
        """Return the pose in the file; the cloth starts without forces.

        Raises:
            RecordingError: the file is missing or malformed, or names a joint the body lacks.
        """
        first, path = recording.indices[0], recording.folder / self.file
        own = path.with_name(f"{path.stem}_{first:06}{path.suffix}")
        if own.is_file():
            path = own
        elif first:
            LOG.warning("%s is taken for the pose of frame %d; %s would come before it", path.name, first, own.name)
        if not path.is_file():
            there = ", ".join(sorted(p.name for p in recording.folder.iterdir()))
            hint = f"the recording has: {there}\nwithout a start pose, use the stage start_from_keypoints"
            raise RecordingError("there is no file with the first pose", where=str(path), hint=hint)
        return Start(pose=read_pose(path, scene.body), parameters=calm(scene.garment))


def read_pose(path: Path, body: Body) -> Pose:
    """Return the pose of a file.

    Raises:
        RecordingError: it is malformed, has numbers that are not finite, or names a joint the body lacks.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        turns = {name: _three(vector) for name, vector in content.get("joint_rotations", {}).items()}
        rotation, translation = _three(content["root_rotation"]), _three(content["root_translation"])
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise RecordingError(f"not a start pose: {_reason(error)}", where=str(path), hint=FORM) from error
    _check_joints(turns, body, str(path))
    return Pose(root=root_at(body, rotation, translation), angles=angles_from_rotations(body, turns))


def root_at(body: Body, rotation: F64, position: F64) -> F64:
    """Return world_from_body (4, 4) that turns by a rotation vector (3,) and puts the root joint at (3,) m."""
    root = twists.exp(np.append(rotation, np.zeros(3)))
    root[:3, 3] = position - root[:3, :3] @ body.positions[0]
    return root


def calm(garment: GarmentMesh | None) -> F64:
    """Return the parameters (Q,) of a garment without forces: zero, or the nearest to it within bounds."""
    return np.empty(0) if garment is None else np.clip(0.0, *garment.parameter_bounds.T)


def _check_joints(turns: dict[str, F64], body: Body, where: str) -> None:
    for name in [name for name in turns if name not in body.joint_names]:
        if body.cut.any():  # a part of a body: the pose may be that of the whole
            del turns[name]
        else:
            hint = alternatives(name, body.joint_names)
            raise RecordingError(f"joint_rotations: the body has no joint '{name}'", where=where, hint=hint)


def _three(numbers: Any) -> F64:
    vector = np.array(numbers, np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{numbers} should be three finite numbers")
    return vector


def _reason(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else str(error)
