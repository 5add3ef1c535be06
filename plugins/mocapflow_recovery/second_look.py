"""Stage `second_look`: frames that leap out from between their neighbours are fitted again, from there."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import PositiveFloat

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import Frame, FrameResult, Past, Pose
from mocapflow.functional import image_cost
from mocapflow.guards.answers import pose_of
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32, Bool
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop, prepared
from mocapflow_recovery.fits import Fits
from mocapflow_recovery.judge import stray_of, surface_of
from mocapflow_recovery.limb_search import LimbSearch

LOG = logging.getLogger("mocapflow")
HELD = 8  # pictures of each camera in memory
LED = 4  # frames before a leap that may have to be looked at again as well, one by one
OTHER_MM = 10.0  # of a joint, between two fits: less, and they are the same
LEAP_WEIGHT = 0.1  # half the leap may cost 0.69 times this share more by the silhouettes
STRAY_WEIGHT = 0.002  # share per cm² of person and skin that lie apart in the other fit


class SecondLook(Stage):
    """Looks again at frames that leap out from between the frame before and the one after.

    A track knows only what came before. Where a limb has moved too far from one frame to the next, the fit may end
    beside it, and a frame later, begun elsewhere, lie on it again. Both neighbours together say better where the limb
    was: the frame begins between them and is settled like any other. Of the two fits that one is kept which the
    pictures like better and which leaps less; where the person has leapt, both are the same. The first and the last
    frame are looked at if the one beside them leaps: the first begins where the next two lead back, the last where it
    is predicted from those before it.

    It goes from later frames to earlier ones: a limb that was lost for some frames is found in one leap, and from there
    each frame leads to the one before. What the pictures surely show is measured as in `limb_search`, by its settings
    in the track: they need the empty scene.
    """

    name: ClassVar[str] = "second_look"
    leap_mm: PositiveFloat = 40.0  # of a joint off where it was before and will be after: more is looked at again

    def run(
        self,
        track: Track,
        loop: CoupledLoop,
        recording: Recording,
        scene: Scene,
        background: Background | None = None,
        flow: ImageFlow | None = None,
        checks: ViewChecks | None = None,
    ) -> Track:
        """Return the track with better fits of some frames, each with a note."""
        if background is None:
            LOG.warning("second_look needs the empty scene, which no stage before makes: no frame is looked at again")
            return track
        model, looked = loop.model_of(scene, background), np.zeros(len(track.frame), bool)
        sight = Hindsight(loop, model, Fits(track, model.scene.body))
        while (suspect := self._leaping(sight.fits) & ~looked).any():
            for rows, pictures in pictured(recording, track.frame, windows(suspect)):
                self._look(rows, [prepared(picture, checks, flow) for picture in pictures], looked, sight)
        return sight.fits.track()

    def _look(self, rows: I32, frames: Sequence[Frame], looked: Bool, sight: Hindsight) -> None:
        """Fit again the rows of a window that leap; neighbours of one that changes are due again.

        The last row shows the colours for those before it. Only the end of the track is fitted again itself, at last.
        """
        shown, colours = dict(zip(rows.tolist(), frames, strict=True)), None
        *inner, last = shown
        for row in reversed(inner):
            if self._due(row, looked, sight):
                colours = sight.colours(shown[row + 1], row + 1) if colours is None else colours
                self._fit_again(row, shown[row], colours, looked, sight)
        if last + 1 == len(looked) and self._due(last, looked, sight):
            colours = sight.colours(shown[last - 1], last - 1)
            self._fit_again(last, shown[last], colours, looked, sight)

    def _due(self, row: int, looked: Bool, sight: Hindsight) -> bool:
        return not looked[row] and bool(self._leaping(sight.fits)[row])

    def _fit_again(self, row: int, frame: Frame, colours: Mapping[str, F64], looked: Bool, sight: Hindsight) -> None:
        """Let the better of two fits of a row stand."""
        fits, past = sight.fits, sight.fits.past(row, colours)
        begin = fits.between(row) if row + 1 < len(looked) else sight.predicted(frame, past)
        result = sight.settled(frame, row, past, begin)
        looked[row] = True
        same = fits.apart(row, result.state.estimate.pose) < OTHER_MM / 1000
        if not same and self._preferred(result, row, fits, sight.strays(frame, row, past, result)):
            fits.take(row, frame, result)
            beside = fits.beside(row)
            looked[beside] = [fits.other(other) for other in beside]

    def _leaping(self, fits: Fits) -> Bool:
        return np.asarray(fits.leaps() > self.leap_mm / 1000)

    def _preferred(self, result: FrameResult, row: int, fits: Fits, stray: tuple[float, float]) -> bool:
        """Return whether another fit of a frame is better, by silhouettes, leaps and what strays (cm², before, now)."""
        pose, first = result.state.estimate.pose, fits.before
        cost = image_cost(first.energy[row], first.energy_terms)
        dearer = (image_cost(result.energy, result.energy_terms) - cost) / max(abs(cost), 1.0)
        farther = np.log(max(fits.leap(row, pose), 1e-9) / fits.leap(row, fits.pose(row)))
        return bool(dearer + LEAP_WEIGHT * farther + STRAY_WEIGHT * (stray[1] - stray[0]) < 0)


class Hindsight(NamedTuple):
    """The loop that has made a track, and its fits as they stand."""

    loop: CoupledLoop
    model: ClothedModel
    fits: Fits

    def settled(self, frame: Frame, row: int, past: Past, begin: Pose) -> FrameResult:
        """Return what the loop makes of a frame from a pose."""
        return self.loop.settled(frame, past, self.model, begin, self.fits.cloth(row).parameters)

    def predicted(self, frame: Frame, past: Past) -> Pose:
        """Return where the loop would begin a frame."""
        return pose_of(self.loop.predictor, frame, past, self.model.scene)

    def colours(self, frame: Frame, row: int) -> Mapping[str, F64]:
        """Return what a frame shows of the person's colours and of feet like the floor; a track does not keep it."""
        past, finder = self.fits.past(row, {}), self.loop.recovery
        result = self.settled(frame, row, past, self.fits.pose(row))
        if isinstance(finder, LimbSearch):
            result = finder.feet_told(frame, result, past, self.model)
        return result.state.segmentation.appearance

    def strays(self, frame: Frame, row: int, past: Past, result: FrameResult) -> tuple[float, float]:
        """Return how much (cm²) of person and model are apart in the fit that stands, and in another one."""
        finder = self.loop.recovery if isinstance(self.loop.recovery, LimbSearch) else LimbSearch()
        surfaces = self.model.surface(self.fits.pose(row), self.fits.cloth(row)), surface_of(self.model, result)
        seen = finder.views(frame, surfaces[0], past, self.model.scene)
        before, now = (stray_of(surface, self.model.scene, seen) for surface in surfaces)
        return before.near + before.floating, now.near + now.floating


def windows(suspect: Bool) -> Iterator[I32]:
    """Yield rows that hang together, at most `HELD`: suspect ones (T,), those that led to them, and the one after.

    The last row of each is there for what it shows alone; where a window is cut, it is the first of the next.
    """
    wanted = suspect.copy()
    for back in range(1, LED + 1):
        wanted[:-back] |= suspect[back:]
    wanted[1:] |= suspect[:-1]
    rows = np.flatnonzero(wanted).astype(np.int32)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        for end in range(len(run) - (len(run) - 2) // (HELD - 1) * (HELD - 1), len(run) + 1, HELD - 1):
            yield run[max(end - HELD, 0) : end]


def pictured(recording: Recording, numbers: I32, groups: Iterable[I32]) -> Iterator[tuple[I32, list[Frame]]]:
    """Yield each group of rows with its frames, whose numbers (T,) are known by row; no picture is decoded twice."""
    held: list[Frame] = []
    coming: Iterator[Frame] | None = None
    for rows in groups:
        first, last = int(numbers[rows[0]]), int(numbers[rows[-1]])
        coming = coming or recording.frames(since=first)
        held = [frame for frame in held if frame.index >= first]
        while not held or held[-1].index < last:
            frame = next(coming)
            held += [frame] if frame.index >= first else []
        yield rows, held
