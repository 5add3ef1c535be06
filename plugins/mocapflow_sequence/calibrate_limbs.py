"""Stage `calibrate_limbs`: the lengths and girth of limbs from silhouettes of many frames."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.assets import Background, Body
from mocapflow.components import Matcher, Segmenter, Stage
from mocapflow.data import Cloth, Frame, Matches, Past, Pose, Segmentation, Turn
from mocapflow.errors import RecordingError
from mocapflow.loop import pool_matches
from mocapflow.recording import Recording
from mocapflow.results import Track
from mocapflow.scene import Scene
from mocapflow.track import believed
from mocapflow_sequence.detections import layout, persons, seen, spread
from mocapflow_sequence.keypoint_fit import fit
from mocapflow_sequence.landmarks import landmarks
from mocapflow_sequence.pose_fit import Solution
from mocapflow_sequence.proportions import PROPORTIONS, scaled
from mocapflow_sequence.silhouette_fit import refine

LOG = logging.getLogger("mocapflow")
Positive = Annotated[float, Field(gt=0)]


class CalibrateLimbs(Stage):
    """Fits proportions that all frames share, and the pose of each, to the contours of some frames.

    A thigh 2 % too long costs 2-3 degrees of the knee; one frame can't tell it from a pose, many can. The poses come
    from an earlier track or, without one, from keypoints.
    """

    name: ClassVar[str] = "calibrate_limbs"
    segmenter: Segmenter  # as in the track
    matchers: Annotated[tuple[Matcher, ...], Field(min_length=1)]  # as in the track
    # contours see neither hip nor shoulder: without the trunk, the thigh would take up what the trunk is wrong by
    proportions: tuple[str, ...] = (  # those that are fitted
        "girth", "trunk", "shoulder_width", "thigh", "shank", "foot", "upper_arm", "forearm",
    )  # fmt: skip
    spread: Positive = 0.05  # standard deviation of a log proportion about the body's
    frames: Annotated[int, Field(ge=1)] = 10  # spread over the recording
    passes: Annotated[int, Field(ge=1)] = 2  # times that the images are segmented
    rounds: Annotated[int, Field(ge=1)] = 6  # matchings a pass
    independent: Annotated[float, Field(gt=0, le=1)] = 0.15  # share of contour pairs that are independent

    def run(
        self, recording: Recording, scene: Scene, background: Background | None = None, track: Track | None = None
    ) -> Body:
        """Return the scene's body with fitted proportions.

        Raises:
            RecordingError: neither a track nor keypoints say where the person is.
        """
        if unknown := set(self.proportions) - set(PROPORTIONS):
            hint = f"there are: {', '.join(PROPORTIONS)}"
            raise RecordingError(f"calibrate_limbs: no proportion '{min(unknown)}'", hint=hint)
        scene = scene.with_background(background)
        indices, poses, clothes = self._from_track(track) if track else self._from_keypoints(recording, scene)
        spreads, body = dict.fromkeys(self.proportions, self.spread), scene.body
        solution = Solution(np.zeros(len(spreads)), tuple(poses))
        for turn in range(self.passes):
            scene = replace(scene, body=scaled(body, solution.factors(spreads)))
            views = self._segmented(recording, scene, indices, solution.poses, clothes)
            matchers = [partial(self._match, scene, *view, Turn(index=turn, cap=self.passes)) for view in views]
            solution = refine(body, matchers, solution, scene.cameras, spreads, self.independent, self.rounds)
        factors = solution.factors(spreads)
        LOG.info("proportions: %s", ", ".join(f"{name} {factor:.3f}" for name, factor in factors.items()))
        return scaled(body, factors)

    def _from_track(self, track: Track) -> tuple[list[int], list[Pose], list[Cloth]]:
        good = np.flatnonzero(track.usable.all(axis=1) & track.steady)
        good = good if len(good) >= self.frames else np.arange(len(track.frame))
        rows = good[np.unique(np.linspace(0, len(good) - 1, self.frames).round().astype(int))]
        clothes = [Cloth(vertices=track.cloth[r].copy(), parameters=track.cloth_parameters[r].copy()) for r in rows]
        return [int(track.frame[r]) for r in rows], [track.pose(int(r)) for r in rows], clothes

    def _from_keypoints(self, recording: Recording, scene: Scene) -> tuple[list[int], list[Pose], list[Cloth]]:
        found = persons(recording, spread(recording.indices, self.frames), scene.cameras)
        names, order = landmarks(scene.body).names, layout(recording, list(found), None)
        _, poses = fit(scene.body, [seen(person, order, names) for person in found.values()], scene.cameras)
        bare = Cloth(vertices=np.empty((0, 3)), parameters=np.empty(0))
        return list(found), list(poses), [bare] * len(found)

    def _segmented(
        self, recording: Recording, scene: Scene, indices: Sequence[int], poses: Sequence[Pose],
        clothes: Sequence[Cloth],
    ) -> list[tuple[Frame, Segmentation, Cloth]]:  # fmt: skip
        """Return the silhouettes of the chosen frames; the images are let go at once."""
        views = []
        wanted = {index: (pose, cloth) for index, pose, cloth in zip(indices, poses, clothes, strict=True)}
        for frame in recording.until(max(indices)).frames(since=min(indices)):
            if frame.index in wanted:
                pose, cloth = wanted[frame.index]
                state = believed(pose, cloth.parameters, cloth)
                found = self.segmenter.segment(frame, state, Past(), scene, Turn(index=0, cap=1))
                views.append((replace(frame, images=(), flow=None), found, cloth))
        return views

    def _match(
        self, scene: Scene, frame: Frame, segmentation: Segmentation, cloth: Cloth, turn: Turn, body: Body, pose: Pose
    ) -> Matches:
        scene = replace(scene, body=body)
        return pool_matches(self.matchers, frame, segmentation, Past(), scene, turn, scene.surface(pose, cloth))
