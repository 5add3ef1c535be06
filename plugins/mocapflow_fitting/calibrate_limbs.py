"""Stage `calibrate_limbs`: the lengths and girth of limbs from silhouettes of many frames."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from mocapflow.assets import Background, Body
from mocapflow.components import Matcher, Segmenter, Stage
from mocapflow.data import Change, Frame, Matches, Past, Pose, Segmentation, Turn
from mocapflow.dressing.roles import Draper
from mocapflow.guards.matcher_inputs import check_matcher_inputs
from mocapflow.guards.outputs import segmentation_of
from mocapflow.model import ClothedModel
from mocapflow.pooling import pool_matches
from mocapflow.prediction import initial_state
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow.track import prepared
from mocapflow_fitting.detections import frames_seen, spaced_evenly
from mocapflow_fitting.keypoint_fit import fit
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.pose_fit import Solution, Spreads
from mocapflow_fitting.proportions import CENTRES, Proportion, fitted, modes_of, scaled
from mocapflow_fitting.silhouette_fit import refine

LOG = logging.getLogger("mocapflow")
# near the solution matchers reach less far and give up what is off
AT_REST = Change(body=0.0, cloth=0.0, angles=0.0, sigmas=0.0)


class CalibrateLimbs(Stage):
    """Fits proportions that all frames share, and the pose of each, to the contours of some frames.

    A thigh 2 % too long costs 2-3 degrees of the knee; one frame can't tell it from a pose, many can. The poses come
    from an earlier track or, without one, from keypoints.

    With `centre_sd_m` it also finds where the hips lie from front to back, and how high the knees: skin that moves with
    a limb shows about what it turns. What is known from the shape of a body alone is off by some 2 cm at the hips.

    Source: Hicks 2005, Gait & Posture 22, 138 (the functional method beside the predictive one)
    """

    name: ClassVar[str] = "calibrate_limbs"
    segmenter: Segmenter  # as in the track
    matchers: Annotated[tuple[Matcher, ...], Field(min_length=1)]  # as in the track
    draper: Draper | None = None  # as in the track; without one the body is fitted bare
    # contours see neither hip nor shoulder: without the trunk, the thigh would take up what the trunk is wrong by
    proportions: tuple[Proportion, ...] = (  # those that are fitted
        "girth", "trunk", "shoulder_width", "thigh", "shank", "foot", "upper_arm", "forearm",
    )  # fmt: skip
    shape: bool = False  # also in what ways people differ most, where the body knows them: the template does
    spread: PositiveFloat = 0.02  # standard deviation of a log proportion from a scan; from a template 0.05
    centre_sd_m: NonNegativeFloat = 0.0  # standard deviation of where hips and knees turn in the body; 0: it is known
    frames: PositiveInt = 10  # spread over the recording
    passes: PositiveInt = 3  # times that the images are segmented; after the first, matching is calm
    rounds: PositiveInt = 3  # matchings a pass
    independent: Annotated[float, Field(gt=0, le=1)] = 1.0  # share of pairs with own errors; all frames count as one

    def need(self, recording: Recording) -> None:
        """Raise if no matcher would find a pair in the recording."""
        check_matcher_inputs(self.matchers, recording)

    def run(
        self,
        recording: Recording,
        scene: Scene,
        background: Background | None = None,
        track: Track | None = None,
        checks: ViewChecks | None = None,
    ) -> Body:
        """Return the scene's body with fitted proportions.

        Raises:
            RecordingError: neither a track nor keypoints say where the person is.
        """
        scene = (scene if self.draper else scene.undressed).with_background(background)
        clothes, poses = self._from_track(track) if track else self._from_keypoints(recording, scene, checks)
        body = scene.body
        modes = modes_of(body) if self.shape else ()
        if self.shape and not modes:
            LOG.warning("shape: this body does not know how people differ, so only its proportions are fitted")
        centres = CENTRES if self.centre_sd_m else ()
        spreads: Spreads = {
            **dict.fromkeys(self.proportions, self.spread),
            **dict.fromkeys(centres, self.centre_sd_m),
            **dict.fromkeys(modes, 1.0),
        }
        share = self.independent / len(clothes)  # contours err alike in all frames: more of them tell no more
        solution = Solution(spreads, np.zeros(len(spreads)), tuple(poses))
        for done in range(self.passes):
            model = self._model(scene, scaled(body, solution.factors))
            part = _in_pass(done, self.passes, recording)
            views = self._segmented(part, checks, model, clothes, solution.poses)
            turn = Turn(index=done, change=AT_REST if done else None)
            matchers = [partial(self._match, scene, *view, turn) for view in views]
            solution = refine(body, matchers, solution, scene.cameras, share, self.rounds)
        return fitted(body, solution.factors)

    def _from_track(self, track: Track) -> tuple[dict[int, F64], list[Pose]]:
        """Return cloth parameters by the frames that are fitted, and poses: the best, if there are enough of them."""
        found = ~track.doubted & ~track.lost
        whole = found & track.usable.all(axis=1)
        for good in (whole & track.steady, whole, found):  # those of a rough track seldom come to rest
            if good.sum() >= self.frames:
                break
        rows = spaced_evenly(np.flatnonzero(good).tolist() or range(len(track.frame)), self.frames)
        return {int(track.frame[r]): track.cloth_parameters[r].copy() for r in rows}, [track.pose(r) for r in rows]

    def _from_keypoints(
        self, recording: Recording, scene: Scene, checks: ViewChecks | None
    ) -> tuple[dict[int, F64], list[Pose]]:
        indices, names = spaced_evenly(recording.indices, self.frames), landmarks(scene.body).names
        found = frames_seen(recording, indices, scene.cameras, names, checks=checks)
        _, poses = fit(scene.body, list(found.values()), scene.cameras)
        return dict.fromkeys(found, scene.neutral_parameters), list(poses)

    def _model(self, scene: Scene, body: Body) -> ClothedModel:
        return ClothedModel(scene=replace(scene, body=body), draper=self.draper)

    def _segmented(
        self, recording: Recording, checks: ViewChecks | None, model: ClothedModel, clothes: Mapping[int, F64],
        poses: Sequence[Pose],
    ) -> list[tuple[Frame, Segmentation, F64]]:  # fmt: skip
        """Return the silhouettes of the chosen frames; the images are let go at once."""
        views, past = [], Past()
        wanted = dict(zip(clothes, poses, strict=True))
        for frame in recording.until(max(clothes)).frames(since=min(clothes)):
            if frame.index in wanted:
                pose, cloth = wanted[frame.index], clothes[frame.index]
                state = initial_state(pose, cloth, model.drape(pose, cloth, past))
                passed = prepared(frame, checks, flow=None)
                found = segmentation_of(self.segmenter, passed, state, past, model.scene, Turn(index=0))
                views.append((replace(passed, images=()), found, cloth))
        return views

    def _match(
        self, scene: Scene, frame: Frame, segmentation: Segmentation, cloth: F64, turn: Turn, body: Body, pose: Pose
    ) -> Matches:
        model, past = self._model(scene, body), Past()
        surface = model.surface(pose, model.drape(pose, cloth, past))
        return pool_matches(self.matchers, frame, segmentation, past, model.scene, turn, surface)


def _in_pass(done: int, passes: int, recording: Recording) -> Recording:
    """Return a recording that is read in each pass, told of as frames of all of them: one count that goes on."""
    return replace(recording, watch=lambda frame, of: recording.watch(done * of + frame, passes * of))
