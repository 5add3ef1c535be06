"""Cameras that are knocked while they film: from which frame on, and how they have turned since their first picture."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.geometry.camera_rotation import LEAST_PX, shift_px, turn_between
from mocapflow.knocks import Knocks
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8, Bool
from mocapflow_robustness.picture_checks import LEAST_CONTRAST, contrast
from mocapflow_robustness.thumbnails import thumbnail

LOG = logging.getLogger("mocapflow")
EVERY_S = 2.0  # between the frames that are compared with the first one; where two differ, all between them are

Moved = tuple[int, F64]  # frame from which on, and how pixels (3, 3) of the first picture lie since


@dataclass
class KnockDetector:
    """What some frames tell about how the cameras stand, while all frames of a recording are read."""

    recording: Recording
    room: dict[int, tuple[U8, Bool]]  # by camera: what it shows in the beginning, and where that is known
    turns: dict[int, list[Moved]] = field(default_factory=dict)  # by camera, of every frame that tells

    def look(self, frame: Frame) -> None:
        """Note how pictures lie to what their cameras show in the beginning, every few seconds and in the last frame.

        Of a camera whose empty room is not known that is its first picture that shows anything.
        """
        every = max(round(EVERY_S * self.recording.frame_rate), 1)
        wanted = frame.index % every == 0 or frame.index == self.recording.length - 1
        for camera in np.flatnonzero(frame.usable).tolist():
            image, hidden = frame.images[camera], frame.hidden_in(camera)
            if camera not in self.room and contrast(thumbnail(image)) >= LEAST_CONTRAST:
                self.room[camera] = image, np.ones(image.shape[:2], bool) if hidden is None else ~hidden
            if wanted and camera in self.room and (turn := self._turn(image, camera)) is not None:
                self.turns.setdefault(camera, []).append((frame.index, turn))

    def knocks(self) -> Knocks | None:
        """Return when cameras have turned, and warn of it; None: none has.

        All frames between two of those looked at that differ are read again.
        """
        found = [(index, camera, turn) for camera in self.turns for index, turn in self._of(camera)]
        if not found:
            return None
        frame, camera, turn = zip(*sorted(found, key=lambda knock: knock[0]), strict=True)
        return Knocks(frame=np.array(frame, np.int32), camera=np.array(camera, np.int16), turn=np.stack(turn))

    def _of(self, camera: int) -> list[Moved]:
        found: list[Moved] = []
        seen, state = -1, np.eye(3)
        for index, turn in self.turns[camera]:
            if self._moved(state, turn, camera):
                found += self._between(camera, seen, index, state)
                state = turn
            seen = index
        if found:
            most = max(shift_px(turn, self.recording.cameras[camera]) for _, turn in found)
            told = f"{self.recording.cameras[camera].name} was knocked in frame {found[0][0]}: its pictures are"
            LOG.warning(f"{told} {most:.1f} px off the first one, and are moved back")
        return found

    def _between(self, camera: int, before: int, last: int, state: F64) -> Iterator[Moved]:
        """Yield the frames after one and up to another in which a camera stands otherwise than in the one before."""
        alone = replace(self.recording.seen_by(camera), indices=range(before + 1, last + 1))
        for frame in alone.frames():
            turn = self._turn(frame.images[0], camera) if frame.usable[0] else None
            if turn is not None and self._moved(state, turn, camera):
                state = turn
                yield frame.index, turn

    def _turn(self, image: U8, camera: int) -> F64 | None:
        room, known = self.room[camera]
        return turn_between(room, image, known, self.recording.cameras[camera])

    def _moved(self, before: F64, after: F64, camera: int) -> bool:
        return shift_px(after @ np.linalg.inv(before), self.recording.cameras[camera]) >= LEAST_PX
