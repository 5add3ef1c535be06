"""Stage `start_from_file`: the first pose as somebody wrote it down."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from mocapflow.assets import Body
from mocapflow.components import Stage
from mocapflow.data import NO_CLOTH, Pose, Start
from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import project
from mocapflow.io.cameras.rigs import PLACE
from mocapflow.io.subject.first_pose import FILE, read_first_pose, read_pose
from mocapflow.recordings.recording import Recording
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
SLACK = 15.0  # deg beyond a limit that a pose may be, written down by eye


class StartFromFile(Stage):
    """Reads the pose of the first frame from `init.json` of the recording.

    A run or a part of one that begins at frame 1200 reads `init_001200.json`, if there is one.
    """

    name: ClassVar[str] = "start_from_file"
    file: str = FILE  # from the folder of the recording

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return the files that are read: their content is part of the cache key."""
        path = folder / self.file
        return [path, *sorted(path.parent.glob(f"{path.stem}_*{path.suffix}"))]

    def need(self, recording: Recording) -> None:
        """Raise if there is no file with the first pose, or none can be read from it."""
        read_first_pose(self._found(recording), joints=())

    def run(self, recording: Recording, scene: Scene) -> Start:
        """Return the pose in the file; the cloth starts without forces.

        Raises:
            RecordingError: the file is missing or malformed, names a joint the body lacks, or puts it where no camera
                sees any of it.
        """
        first, path = recording.indices[0], self._found(recording)
        if first and path == recording.folder / self.file:
            own = _own(path, first).name
            LOG.warning("%s is taken for the pose of frame %d; %s would come before it", path.name, first, own)
        pose = read_pose(path, scene.body)
        if odd := beyond_limits(pose, scene.body):
            LOG.warning("%s bends joints as nobody can: %s; are its turns in radians, of the right sign?", path, odd)
        if not in_view(pose, scene):
            raise RecordingError("no camera sees the person at the first pose", where=str(path), hint=PLACE)
        return Start(pose=pose, parameters=scene.neutral_parameters)

    def _found(self, recording: Recording) -> Path:
        """Return the file with the pose of the first frame."""
        path = recording.folder / self.file
        for found in (_own(path, recording.indices[0]), path):
            if found.is_file():
                return found
        there = ", ".join(sorted(p.name for p in recording.folder.iterdir()))
        hint = f"the recording has: {there}\nelse use the stage start_from_silhouettes or start_from_keypoints"
        raise RecordingError("there is no file with the first pose", where=str(path), hint=hint)


def _own(path: Path, frame: int) -> Path:
    """Return the file with the pose of one frame."""
    return path.with_name(f"{path.stem}_{frame:06}{path.suffix}")


def in_view(pose: Pose, scene: Scene) -> bool:
    """Return whether any camera sees anything of the bare body at a pose."""
    body = scene.undressed.surface(pose, NO_CLOTH).vertices
    places = [(project(body, camera), camera.size) for camera in scene.cameras]
    with np.errstate(invalid="ignore"):
        return any(((pixel >= 0) & (pixel < size)).all(axis=1).any() for pixel, size in places)


def beyond_limits(pose: Pose, body: Body) -> str:
    """Return which angles of a pose are far beyond what a joint can do, "" where none is."""
    low, high = np.degrees(body.limits.T)
    angles = np.degrees(pose.angles)
    far = np.flatnonzero((angles < low - SLACK) | (angles > high + SLACK))
    return ", ".join(f"{body.screw_names[k]} {angles[k]:.0f}° of {low[k]:.0f}° to {high[k]:.0f}°" for k in far)
