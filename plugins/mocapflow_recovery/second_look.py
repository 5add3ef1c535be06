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
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32, Bool
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop, prepared
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_recovery.revised_track import RevisedTrack
from mocapflow_recovery.scoring import mismatch_of, surface_of

LOG = logging.getLogger("mocapflow")
WINDOW = 8  # pictures of each camera in memory
LEAD_IN = 4  # frames before a leap that may have to be looked at again as well, one by one
OTHER_MM = 10.0  # of a joint, between two fits: less, and they are the same
LEAP_WEIGHT = 0.1  # half the leap may cost 0.69 times this share more by the silhouettes
MISMATCH_WEIGHT = 0.002  # share per cm² of person and skin that lie apart in the other fit


class SecondLook(Stage):
    """Looks again at frames that leap out from between the frame before and the one after.

    A track knows only what came before. Where a limb has moved too far from one frame to the next, the fit may end
    beside it, and a frame later, begun elsewhere, lie on it again. Both neighbours together say better where the limb
    was: the frame begins between them and is settled like any other. Of the two fits that one is kept which the
    pictures like better and which leaps less; where the person has leapt, both are the same.

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
        model, tried = loop.model_of(scene, background), np.zeros(len(track.frame), bool)
        refitter = Refitter(loop, model, RevisedTrack(track, model.scene.body))
        while (suspect := self._leaping(refitter.revised) & ~tried).any():
            for rows, pictures in pictured(recording, track.frame, windows(suspect)):
                self._refit(rows, [prepared(picture, checks, flow) for picture in pictures], tried, refitter)
        return refitter.revised.track()

    def _refit(self, rows: I32, frames: Sequence[Frame], tried: Bool, refitter: Refitter) -> None:
        """Fit again the rows of a window that leap, but the last; neighbours of one that changes are due again."""
        revised, appearance = refitter.revised, None
        for row, frame, after in reversed(list(zip(rows.tolist(), frames, frames[1:], strict=False))):
            if tried[row] or not self._leaping(revised)[row]:
                continue
            appearance = refitter.appearance(after, row + 1) if appearance is None else appearance
            past = revised.past(row, appearance)
            result = refitter.settled(frame, row, past, revised.between(row))
            tried[row] = True
            same = revised.largest_move(row, result.state.estimate.pose) < OTHER_MM / 1000
            if not same and self._preferred(result, row, revised, refitter.mismatches(frame, row, past, result)):
                revised.replace_fit(row, frame, result)
                tried[[row - 1, row + 1]] = revised.replaced(row - 1), revised.replaced(row + 1)

    def _leaping(self, revised: RevisedTrack) -> Bool:
        return np.asarray(revised.leaps() > self.leap_mm / 1000)

    def _preferred(self, result: FrameResult, row: int, revised: RevisedTrack, mismatch: tuple[float, float]) -> bool:
        """Return whether another fit of a frame is better, by silhouettes, leaps and mismatch (cm², before, now)."""
        pose, first = result.state.estimate.pose, revised.before
        cost = image_cost(first.energy[row], first.energy_terms)
        dearer = (image_cost(result.energy, result.energy_terms) - cost) / max(abs(cost), 1.0)
        farther = np.log(max(revised.leap_of(row, pose), 1e-9) / revised.leap_of(row, revised.pose(row)))
        return bool(dearer + LEAP_WEIGHT * farther + MISMATCH_WEIGHT * (mismatch[1] - mismatch[0]) < 0)


class Refitter(NamedTuple):
    """The loop that has made a track, and its fits as they stand."""

    loop: CoupledLoop
    model: ClothedModel
    revised: RevisedTrack

    def settled(self, frame: Frame, row: int, past: Past, begin: Pose) -> FrameResult:
        """Return what the loop makes of a frame from a pose."""
        return self.loop.settled(frame, past, self.model, begin, self.revised.cloth(row).parameters)

    def appearance(self, frame: Frame, row: int) -> Mapping[str, F64]:
        """Return what a frame shows of the person's colours and of feet like the floor; a track does not keep it."""
        past, finder = self.revised.past(row, {}), self.loop.recovery
        result = self.settled(frame, row, past, self.revised.pose(row))
        if isinstance(finder, LimbSearch):
            result = finder.with_camouflaged_feet(frame, result, past, self.model)
        return result.state.segmentation.appearance

    def mismatches(self, frame: Frame, row: int, past: Past, result: FrameResult) -> tuple[float, float]:
        """Return the mismatch (cm²) of person and model in the fit that stands, and in another one."""
        finder = self.loop.recovery if isinstance(self.loop.recovery, LimbSearch) else LimbSearch()
        surfaces = self.model.surface(self.revised.pose(row), self.revised.cloth(row)), surface_of(self.model, result)
        trimaps = finder.trimaps(frame, surfaces[0], past, self.model.scene)
        before, now = (mismatch_of(surface, self.model.scene, trimaps) for surface in surfaces)
        return before.hint + before.floating, now.hint + now.floating


def windows(suspect: Bool) -> Iterator[I32]:
    """Yield rows that hang together, at most `WINDOW`: suspect ones (T,), those that led to them, and the one after.

    The last row of each is there for what it shows alone; where a window is cut, it is the first of the next.
    """
    wanted = suspect.copy()
    for back in range(1, LEAD_IN + 1):
        wanted[:-back] |= suspect[back:]
    wanted[1:] |= suspect[:-1]
    rows = np.flatnonzero(wanted).astype(np.int32)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        for end in range(len(run) - (len(run) - 2) // (WINDOW - 1) * (WINDOW - 1), len(run) + 1, WINDOW - 1):
            yield run[max(end - WINDOW, 0) : end]


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
