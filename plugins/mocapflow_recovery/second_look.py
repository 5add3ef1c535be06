"""Stage `second_look`: frames that leap out from between their neighbours are fitted again, from there."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import PositiveFloat

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import Frame, FrameResult, Past, Pose
from mocapflow.functional import image_cost
from mocapflow.guards.outputs import pose_of
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, I32, Bool
from mocapflow.results import ImageFlow, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.track import CoupledLoop, prepared
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_recovery.refit_windows import pictured, windows
from mocapflow_recovery.revised_track import RevisedTrack
from mocapflow_recovery.scoring import mismatch_of

LOG = logging.getLogger("mocapflow")
OTHER_MM = 10.0  # of a joint, between two fits: less, and they are the same
LEAP_WEIGHT = 0.1  # half the leap may cost 0.69 times this share more by the silhouettes
MISMATCH_WEIGHT = 0.002  # share per cm² of person and skin that lie apart in the other fit


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
        model, tried = loop.model_of(scene, background), np.zeros(len(track.frame), bool)
        refitter = Refitter(loop, model, RevisedTrack(track, model.scene.body), self.leap_mm / 1000, tried)
        while (due := refitter.due()).any():
            for rows, pictures in pictured(recording, track.frame, windows(due)):
                refitter.refit(rows, [prepared(picture, checks, flow) for picture in pictures])
        return refitter.revised.track()


class Refitter(NamedTuple):
    """Fits frames of a track again, with the loop that has made it."""

    loop: CoupledLoop
    model: ClothedModel
    revised: RevisedTrack
    leap_m: float  # more is fitted again
    tried: Bool  # (T,) True where it was since a fit beside it has changed

    def due(self) -> Bool:
        """Return the rows (T,) that are to be fitted again."""
        return np.asarray((self.revised.leaps() > self.leap_m) & ~self.tried)

    def refit(self, rows: I32, frames: Sequence[Frame]) -> None:
        """Fit again the rows of a window that leap; neighbours of one that changes are due again.

        The last row shows the colours for those before it. Only the end of the track is fitted again itself, at last.
        """
        shown, appearance = dict(zip(rows.tolist(), frames, strict=True)), None
        *inner, last = shown
        for row in reversed(inner):
            if self.due()[row]:
                appearance = self.appearance(shown[row + 1], row + 1) if appearance is None else appearance
                self._fit_again(row, shown[row], appearance)
        if last + 1 == len(self.tried) and self.due()[last]:
            self._fit_again(last, shown[last], self.appearance(shown[last - 1], last - 1))

    def _fit_again(self, row: int, frame: Frame, appearance: Mapping[str, F64]) -> None:
        """Let the better of two fits of a row stand."""
        revised, past = self.revised, self.revised.past(row, appearance)
        inner = row + 1 < len(self.tried)
        begin = revised.between(row) if inner else pose_of(self.loop.predictor, frame, past, self.model.scene)
        result = self.settled(frame, row, past, begin)
        self.tried[row] = True
        same = revised.largest_move(row, result.state.estimate.pose) < OTHER_MM / 1000
        if not same and self._preferred(result, row, self.more_mismatch(frame, row, past, result)):
            revised.replace_fit(row, frame, result)
            beside = revised.beside(row)
            self.tried[beside] = [revised.replaced(other) for other in beside]

    def _preferred(self, result: FrameResult, row: int, more_cm2: float) -> bool:
        """Return whether another fit of a frame is better, by silhouettes, leaps, and how much more lies apart."""
        pose, revised, first = result.state.estimate.pose, self.revised, self.revised.before
        cost = image_cost(first.energy[row], first.energy_terms)
        dearer = (image_cost(result.energy, result.energy_terms) - cost) / max(abs(cost), 1.0)
        farther = np.log(max(revised.leap_of(row, pose), 1e-9) / revised.leap_of(row, revised.pose(row)))
        return bool(dearer + LEAP_WEIGHT * farther + MISMATCH_WEIGHT * more_cm2 < 0)

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

    def more_mismatch(self, frame: Frame, row: int, past: Past, result: FrameResult) -> float:
        """Return how much more (cm²) of person and model lies apart in another fit than in the one that stands."""
        finder = self.loop.recovery if isinstance(self.loop.recovery, LimbSearch) else LimbSearch()
        scene = self.model.scene
        surfaces = scene.surface(self.revised.pose(row), self.revised.cloth(row)), scene.surface_of(result.state)
        trimaps = finder.trimaps(frame, surfaces[0], past, scene)
        before, now = (mismatch_of(surface, scene, trimaps) for surface in surfaces)
        return (now.hint + now.floating) - (before.hint + before.floating)
