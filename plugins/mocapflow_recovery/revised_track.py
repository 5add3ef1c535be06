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
from mocapflow.results import Track, in_order, values_of
from mocapflow.series import overwritten

REFITTED = "fitted again from between its neighbours"
END_REFITTED = "fitted again, for the frame beside it leaps"
LEAST_FRAMES = 3  # of a track, for one to lie between two others
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
        if other := self._found.get(row):
            return Cloth(vertices=other["cloth"], parameters=other["cloth_parameters"])
        return self.before.cloth_at(row)

    def replaced(self, row: int) -> bool:
        """Return whether a row has another fit than the track had."""
        return row in self._found

    def leaps(self) -> F64:
        """Return how far (T,) m a joint of each frame is from between where it is before and after, at most.

        0 where the frame or one of its neighbours is lost. The first and the last frame leap as the one beside them
        does: either of the two may be wrong.
        """
        known, centres = ~self.before.lost, self._centres
        if len(centres) < LEAST_FRAMES:
            return np.zeros(len(centres))
        sure = known[:-2] & known[1:-1] & known[2:]
        off = _off(centres[:-2], centres[1:-1], centres[2:], self._later()[:, None, None])
        return np.pad(sure * np.linalg.norm(off, axis=2).max(axis=1, initial=0), 1, mode="edge")

    def leap_of(self, row: int, pose: Pose) -> float:
        """Return how far (m) joints would be from between those before and after, RMS, if a row had a pose.

        The joints are those of the row, or of the frame beside it if it is the first or the last.
        """
        inner = min(max(row, 1), len(self._centres) - 2)
        three = self._centres[inner - 1 : inner + 2].copy()
        three[row - inner + 1] = self._joints(pose)
        before, here, after = three
        off = _off(before, here, after, self._later()[inner - 1])
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))

    def largest_move(self, row: int, pose: Pose) -> float:
        """Return how far (m) a pose moves the joint of a row that it moves most."""
        return float(np.linalg.norm(self._joints(pose) - self._centres[row], axis=1).max())

    def between(self, row: int) -> Pose:
        """Return the pose between the frames before and after a row; of the first, where the next two lead back."""
        (one, other), time = (row - 1, row + 1) if row else (1, 2), self.before.time
        share = (time[row] - time[one]) / (time[other] - time[one])
        return moved(self.pose(one), share * increment_between(self.pose(one), self.pose(other)))

    def beside(self, row: int) -> list[int]:
        """Return the rows before and after a row, of those that the track has."""
        return [other for other in (row - 1, row + 1) if 0 <= other < len(self._centres)]

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
        again = {row: REFITTED if len(self.beside(row)) == 2 else END_REFITTED for row in found}
        notes = in_order([*track.notes, *(f"frame {track.frame[row]}: {again[row]}" for row in found)])
        return replace(track, notes=notes, **changes)

    def _later(self) -> F64:
        """Return how far (T - 2,) on the way from the frame before to the one after each inner frame lies, 0 to 1."""
        time = self.before.time
        return np.asarray((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))

    def _joints(self, pose: Pose) -> F64:
        centres: F64 = kinematics.joint_centres(self._body, pose.root[None], pose.angles[None])[0]
        return centres

    def _moment(self, row: int) -> Moment:
        track, other = self.before, self._found.get(row)
        observed = other["observed"] if other else track.observed[row].copy()
        return Moment(time=float(track.time[row]), pose=self.pose(row), cloth=self.cloth(row), observed=observed)


def _off(before: F64, here: F64, after: F64, later: F64) -> F64:
    """Return how far (…, J, 3) m joints are from between two frames, `later` (0 to 1) on the way to the second."""
    return np.asarray(here - ((1 - later) * before + later * after))
