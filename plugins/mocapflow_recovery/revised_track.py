"""A track in which some frames are replaced by other fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import REMEMBERED, Cloth, Frame, FrameResult, Moment, Past, Pose
from mocapflow.geometry import kinematics
from mocapflow.model import increment_between, moved
from mocapflow.records import F64, array_fields
from mocapflow.results import Track, values_of
from mocapflow.series import overwritten

REFITTED = "fitted again from between its neighbours"
KEPT = ("frame", "time", "usable", "doubted", "seconds", "raw_root", "raw_angles")  # of the first fit


class RevisedTrack:
    """The poses of a track, and how far each leaps.

    Args:
        track: as it was made; T frames.
        body: whose joints are looked at; J of them.
    """

    def __init__(self, track: Track, body: Body) -> None:
        self.before, self._body = track, body
        self._found: dict[int, dict[str, Any]] = {}  # numbers of other fits; pictures and silhouettes would not fit in
        self._centres = kinematics.joint_centres(body, track.root, track.angles)

    def pose(self, row: int) -> Pose:
        """Return the pose of a row as it stands."""
        other = self._found.get(row)
        return Pose(root=other["root"], angles=other["angles"]) if other else self.before.pose(row)

    def cloth(self, row: int) -> Cloth:
        """Return the cloth of a row as it stands."""
        track, other = self.before, self._found.get(row)
        if other:
            return Cloth(vertices=other["cloth"], parameters=other["cloth_parameters"])
        return Cloth(vertices=np.array(track.cloth[row]), parameters=track.cloth_parameters[row].copy())

    def replaced(self, row: int) -> bool:
        """Return whether a row has another fit than the track had."""
        return row in self._found

    def leaps(self) -> F64:
        """Return how far (T,) m a joint of each frame is from between where it is before and after, at most.

        0 where the frame or one of its neighbours is lost, and at the ends.
        """
        far, known = np.zeros(len(self._centres)), ~self.before.lost
        sure = known[:-2] & known[1:-1] & known[2:]
        far[1:-1] = sure * np.linalg.norm(self._centres[1:-1] - self._between(), axis=2).max(axis=1, initial=0)
        return far

    def leap_of(self, row: int, pose: Pose) -> float:
        """Return how far (m) the joints of an inner row would be from between those before and after, RMS."""
        off = self._joints(pose) - self._between()[row - 1]
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))

    def largest_move(self, row: int, pose: Pose) -> float:
        """Return how far (m) a pose moves the joint of a row that it moves most."""
        return float(np.linalg.norm(self._joints(pose) - self._centres[row], axis=1).max())

    def between(self, row: int) -> Pose:
        """Return the pose between the frames before and after a row."""
        before, after = self.pose(row - 1), self.pose(row + 1)
        return moved(before, self._later()[row - 1] * increment_between(before, after))

    def past(self, row: int, appearance: Mapping[str, F64]) -> Past:
        """Return what a frame may know of those before it."""
        moments = tuple(self._moment(earlier) for earlier in range(max(0, row - REMEMBERED), row))
        return Past(moments=moments, appearance=appearance).trusted()

    def replace_fit(self, row: int, frame: Frame, result: FrameResult) -> None:
        """Let a row stand with another fit."""
        self._centres[row] = self._joints(result.state.estimate.pose)
        cloth = {"cloth": result.state.cloth.vertices}
        self._found[row] = values_of(frame, result, self.before.step_names) | cloth

    def track(self) -> Track:
        """Return the track as it stands, with a note on each frame that has another fit."""
        if not self._found:
            return self.before
        track, found = self.before, self._found
        changes: dict[str, Any] = {
            name: overwritten(getattr(track, name), {row: values[name] for row, values in found.items()})
            for name in array_fields(Track)
            if name not in KEPT
        }
        notes = sorted([*track.notes, *(f"frame {track.frame[row]}: {REFITTED}" for row in found)], key=_frame_of)
        return replace(track, notes=tuple(notes), **changes)

    def _later(self) -> F64:
        """Return how far (T - 2,) on the way from the frame before to the one after each inner frame lies, 0 to 1."""
        time = self.before.time
        return np.asarray((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))

    def _between(self) -> F64:
        """Return where the joints of the inner frames (T - 2, J, 3) m are between those before and after."""
        later = self._later()[:, None, None]
        return np.asarray((1 - later) * self._centres[:-2] + later * self._centres[2:])

    def _joints(self, pose: Pose) -> F64:
        centres: F64 = kinematics.joint_centres(self._body, pose.root[None], pose.angles[None])[0]
        return centres

    def _moment(self, row: int) -> Moment:
        track, other = self.before, self._found.get(row)
        observed = other["observed"] if other else track.observed[row].copy()
        return Moment(time=float(track.time[row]), pose=self.pose(row), cloth=self.cloth(row), observed=observed)


def _frame_of(note: str) -> int:
    return int(note.removeprefix("frame ").partition(":")[0])
