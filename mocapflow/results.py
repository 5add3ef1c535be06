"""What stages hand over: wrong pictures, image flow, the track over all frames, files, how far it is from the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.data import UNKNOWN, Cloth, Flow, Frame, FrameResult, Pose, blind
from mocapflow.knocks import Knocks
from mocapflow.records import F32, F64, I16, I32, Bool, Watch, array, record, silent
from mocapflow.series import Numbers, Wide, changed


@record
class ViewChecks:
    """Pictures of a recording that are not what a camera saw at that moment, or not from where it was calibrated."""

    frame: I32 = array("P", unit="frame index, ascending")
    camera: I16 = array("P", unit="camera index")
    reasons: tuple[str, ...]  # P, for people
    knocks: Knocks | None = None  # None: all cameras stood still

    def stabilised(self, frame: Frame) -> Frame:
        """Return a frame as knocked cameras would have seen it, had they stood still."""
        return frame if self.knocks is None else self.knocks.undone(frame)

    def people(self, index: int, people: Sequence[F64]) -> tuple[F64, ...]:
        """Return the keypoints of a frame, per camera (N, K, 3), stabilised; none of wrong views."""
        steady = people if self.knocks is None else self.knocks.people(index, people)
        wrong = self.camera[self.frame == index]
        return tuple(points[:0] if camera in wrong else points for camera, points in enumerate(steady))

    def passed(self, frame: Frame) -> Frame:
        """Return a frame, stabilised, whose wrong views are not usable."""
        frame = self.stabilised(frame)
        first, last = np.searchsorted(self.frame, [frame.index, frame.index + 1])
        if first == last:
            return frame
        usable, reasons = frame.usable.copy(), list(frame.reasons or [""] * len(frame.usable))
        for camera, reason in zip(self.camera[first:last], self.reasons[first:last], strict=True):
            usable[camera], reasons[camera] = False, reason
        return replace(frame, usable=usable, reasons=tuple(reasons))


@record
class ImageFlow:
    """The image flow of a recording: what was tracked into each frame from the frame before it in the run."""

    frame: I32 = array("P", unit="frame index, ascending")
    camera: I16 = array("P", unit="camera index, ascending within a frame")
    pixel: F32 = array("P", 2, unit="px, in the frame before")
    displacement: F32 = array("P", 2, unit="px")
    cameras: int

    def into(self, index: int) -> tuple[Flow, ...]:
        """Return the flow into a frame, one per camera."""
        first, last = np.searchsorted(self.frame, [index, index + 1])
        borders = first + np.searchsorted(self.camera[first:last], np.arange(self.cameras + 1))
        views = [slice(*pair) for pair in pairwise(borders.tolist())]
        return tuple(Flow(pixel=self.pixel[view], displacement=self.displacement[view]) for view in views)


@record
class Track:
    """The result over T frames; what is wide may be read from the store only when it is asked for."""

    frame: I32 = array("T", unit="frame index in the videos")
    time: F64 = array("T", unit="s")
    root: F64 = array("T", 4, 4, unit="m, world_from_body")
    angles: F64 = array("T", "D", unit="rad")
    covariance: Wide = array("T", "R", "R", unit="rad², rad m and m² of (omega in rad, v in m, angles in rad)")
    observed: F64 = array("T", "D", unit="1, share of the priors' variance of each angle that the images took away")
    cloth: Wide = array("T", "W", 3, unit="m")
    cloth_parameters: F64 = array("T", "Q", unit="by name")
    iterations: I16 = array("T", unit="turns of the loop")
    steady: Bool = array("T", unit="True where the loop came to rest")
    oscillating: Bool = array("T", unit="True where it swung between two states")
    doubted: Bool = array("T", unit="True where images or keypoints contradict the fit, and nothing better was found")
    usable: Bool = array("T", "C", unit="False: lost or corrupted view")
    overlap: F64 = array("T", "C", unit="1, intersection over union of model and image silhouette")
    seconds: F64 = array("T", "K", unit="s of CPU per step of the loop")
    step_names: tuple[str, ...]  # the K steps
    energy: F64 = array("T", "U", "E", unit="terms of the functional after each turn of the loop; NaN after the last")
    energy_terms: tuple[str, ...]  # the E terms
    notes: tuple[str, ...] = ()  # what happened to frames, e.g. "frame 12: cam02 black"
    raw_root: F64 | None = array("T", 4, 4, unit="m, world_from_body, before smoothing", default=None)
    raw_angles: F64 | None = array("T", "D", unit="rad, before smoothing", default=None)

    @property
    def frame_rate(self) -> float:
        """Frames per second, see `frame_rate_of`."""
        return frame_rate_of(self.time)

    @cached_property
    def lost(self) -> Bool:
        """True (T,) where nothing was fitted: no turn, no usable view, none that told anything, or nothing is known."""
        unused = (self.usable.shape[1] > 0) & ~self.usable.any(axis=1)
        empty = np.array([blind(row) for row in self.observed], bool)
        known = np.array([np.isfinite(spread).all() for spread in self.covariance], bool)
        return np.asarray((self.iterations == 0) | unused | empty | ~known)

    @property
    def before_smoothing(self) -> Track:
        """The track as the loop left it: of lost frames nothing was known before they were bridged."""
        if self.raw_root is None or self.raw_angles is None:
            return self
        covariance = changed(self.covariance, partial(_unknown, self.lost))
        return replace(self, root=self.raw_root, angles=self.raw_angles, covariance=covariance)

    def pose(self, row: int) -> Pose:
        """Return the pose of one row."""
        return Pose(root=self.root[row].copy(), angles=self.angles[row].copy())

    def cloth_at(self, row: int) -> Cloth:
        """Return the cloth of one row."""
        return Cloth(vertices=np.array(self.cloth[row]), parameters=self.cloth_parameters[row].copy())


def _unknown(lost: Bool, covariance: F64, rows: Numbers) -> F64:
    """Return the covariances of rows (K,), of lost frames those of a pose that nobody has seen."""
    return np.where(lost[rows, None, None], UNKNOWN * np.eye(covariance.shape[1]), covariance)


def rows_with_frames(track: Track, frames: Iterable[Frame], checks: ViewChecks | None) -> Iterator[tuple[int, Frame]]:
    """Yield rows of a track, each with the frame that it is of, to be drawn on: see `ViewChecks.stabilised`."""
    rows = {int(index): row for row, index in enumerate(track.frame)}
    for frame in frames:
        if frame.index in rows:
            yield rows[frame.index], frame if checks is None else checks.stabilised(frame)


def values_of(frame: Frame, result: FrameResult, steps: Sequence[str]) -> dict[str, Any]:
    """Return all numbers of a frame by the names of their columns; the covariance is that of the pose."""
    estimate, rank = result.state.estimate, 6 + len(result.state.estimate.pose.angles)
    return {
        "frame": frame.index, "time": frame.time, "root": estimate.pose.root, "angles": estimate.pose.angles,
        "cloth_parameters": result.state.cloth.parameters, "iterations": result.iterations, "steady": result.steady,
        "oscillating": result.oscillating, "doubted": result.doubted, "body_change": result.change.body,
        "cloth_change": result.change.cloth, "angle_change": result.change.angles, "usable": frame.usable,
        "overlap": result.overlap,
        "seconds": [result.seconds.get(step, 0.0) for step in steps], "match_count": len(result.state.matches.weight),
        "energy": result.energy, "observed": estimate.observed, "covariance": estimate.covariance[:rank, :rank],
    }  # fmt: skip


def frame_rate_of(time: F64) -> float:
    """Return how many frames there are in a second by their times (T,) s; 30 where a single frame does not tell."""
    return float(1 / np.median(np.diff(time))) if len(time) > 1 else 30.0


def notes_of(frames: I32, notes: Iterable[str]) -> tuple[str, ...]:
    """Return the notes of a track that are about given frames (K,)."""
    heads = {f"frame {frame}" for frame in frames.tolist()}
    return tuple(note for note in notes if note.partition(":")[0] in heads)


def in_order(notes: Iterable[str]) -> tuple[str, ...]:
    """Return the notes of a track in the order of the frames they are about."""
    return tuple(sorted(notes, key=lambda note: int(note.removeprefix("frame ").partition(":")[0])))


@record
class RunFolder:
    """Where a run writes its results, and how it was made."""

    path: Path
    recipe: Mapping[str, Any]  # pipeline, settings, versions, and per finished stage: key, cached, seconds, warnings
    watch: Watch = silent  # to be told how many frames are written, of how many


@record
class Files:
    """Files written into the run folder; a stage that returns them always runs."""

    paths: tuple[Path, ...]


@record
class Evaluation:
    """One row per compared angle; a stage that returns it always runs."""

    reference: str  # the file compared with, "" where there is none
    rows: tuple[Mapping[str, float | str], ...]
    notes: tuple[str, ...] = ()  # what a reader of the rows should know, or why there are none
    pictures: tuple[Path, ...] = ()  # drawn of the comparison
    curves: Mapping[str, F64] = field(default_factory=dict)  # (T,) deg, of the reference at our frames: those compared
