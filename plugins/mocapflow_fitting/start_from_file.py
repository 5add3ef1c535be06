"""Stage `start_from_file`: the first pose as somebody wrote it down."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from mocapflow.assets import Body
from mocapflow.components import Stage
from mocapflow.data import Pose, Start
from mocapflow.errors import RecordingError
from mocapflow.geometry import twists
from mocapflow.geometry.joints import angles_from_rotations
from mocapflow.io.first_pose import read_first_pose
from mocapflow.io.rigs import examine_view
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
SLACK = 15.0  # deg beyond a limit that a pose may be, written down by eye


class StartFromFile(Stage):
    """Reads the pose of the first frame from `init.json` of the recording.

    A run or a part of one that begins at frame 1200 reads `init_001200.json`, if there is one.
    """

    name: ClassVar[str] = "start_from_file"
    file: str = "init.json"  # from the folder of the recording

    def inputs(self, recording: Path) -> Sequence[Path]:
        """Return the files that are read: their content is part of the cache key."""
        path = recording / self.file
        return [path, *sorted(path.parent.glob(f"{path.stem}_*{path.suffix}"))]

    def need(self, recording: Recording) -> None:
        """Raise if there is no file with the first pose, or no camera sees the root joint there."""
        path = self._found(recording)
        root = read_first_pose(path, ()).position
        for finding in examine_view(recording.cameras, root, "the root joint of the first pose"):
            if finding.severity == "error":
                raise RecordingError(finding.message, where=str(path), hint=finding.hint)

    def run(self, recording: Recording, scene: Scene) -> Start:
        """Return the pose in the file; the cloth starts without forces.

        Raises:
            RecordingError: the file is missing or malformed, or names a joint the body lacks.
        """
        first, path = recording.indices[0], self._found(recording)
        if first and path == recording.folder / self.file:
            own = _own(path, first).name
            LOG.warning("%s is taken for the pose of frame %d; %s would come before it", path.name, first, own)
        pose = read_pose(path, scene.body)
        if odd := beyond_limits(pose, scene.body):
            LOG.warning("%s bends joints as nobody can: %s; are its turns in radians, of the right sign?", path, odd)
        return Start(pose=pose, parameters=scene.calm)

    def _found(self, recording: Recording) -> Path:
        """Return the file with the pose of the first frame."""
        path = recording.folder / self.file
        own = _own(path, recording.indices[0])
        if own.is_file() or path.is_file():
            return own if own.is_file() else path
        there = ", ".join(sorted(p.name for p in recording.folder.iterdir()))
        hint = f"the recording has: {there}\nwithout a start pose, use the stage start_from_keypoints"
        raise RecordingError("there is no file with the first pose", where=str(path), hint=hint)


def _own(path: Path, frame: int) -> Path:
    """Return the file with the pose of one frame."""
    return path.with_name(f"{path.stem}_{frame:06}{path.suffix}")


def read_pose(path: Path, body: Body) -> Pose:
    """Return the pose of a file; of a part of a body where the file may be that of the whole.

    Raises:
        RecordingError: it is malformed, in other units, or names a joint the body lacks.
    """
    found = read_first_pose(path, () if body.cut.any() else body.joint_names)
    turns = {name: turn for name, turn in found.turns.items() if name in body.joint_names}
    return Pose(root=root_at(body, found.rotation, found.position), angles=angles_from_rotations(body, turns))


def beyond_limits(pose: Pose, body: Body) -> str:
    """Return which angles of a pose are far beyond what a joint can do, "" where none is."""
    low, high = np.degrees(body.limits.T)
    angles = np.degrees(pose.angles)
    far = np.flatnonzero((angles < low - SLACK) | (angles > high + SLACK))
    return ", ".join(f"{body.screw_names[k]} {angles[k]:.0f}° of {low[k]:.0f}° to {high[k]:.0f}°" for k in far)


def root_at(body: Body, rotation: F64, position: F64) -> F64:
    """Return world_from_body (4, 4) that turns by a rotation vector (3,) and puts the root joint at (3,) m."""
    root = twists.exp(np.append(rotation, np.zeros(3)))
    root[:3, 3] = position - root[:3, :3] @ body.positions[0]
    return root
