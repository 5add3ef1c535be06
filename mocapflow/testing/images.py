"""What the steps that look at images have to hold to: predictors, segmenters, matchers."""

from __future__ import annotations

import numpy as np
import pytest

from mocapflow.components import Matcher, Predictor, Segmenter
from mocapflow.data import Matches
from mocapflow.guards.outputs import matches_of, pose_of, segmentation_of
from mocapflow.model import moved
from mocapflow.testing import pictures, scenes
from mocapflow.testing.component import TURN, Conformance
from mocapflow.testing.same import assert_pure


class PredictorConformance(Conformance):
    """A predictor."""

    role = "predictor"
    predictor: Predictor

    @pytest.mark.parametrize("known", [1, 2])
    def test_it_guesses_a_pose(self, known: int) -> None:
        """One or two earlier frames give a pose near the last one; nothing is changed."""
        scene = scenes.tiny_scene()
        poses = [moved(scenes.tiny_pose(scene, 2), 0.02 * k * np.ones(6 + len(scene.body.limits))) for k in range(2)]
        past = scenes.tiny_past(scene, *poses[-known:])
        guess = assert_pure(pose_of, self.predictor, pictures.tiny_frame(scene, poses[-1]), past, scene)
        np.testing.assert_allclose(guess.root[:3, :3] @ guess.root[:3, :3].T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(guess.root[3], [0, 0, 0, 1], atol=1e-12)
        assert np.abs(guess.angles - poses[-1].angles).max() < 0.5


class SegmenterConformance(Conformance):
    """A segmenter, on pictures of a bright person in a grey room whose empty view is known."""

    role = "segmenter"
    segmenter: Segmenter
    least_overlap = 0.7  # intersection over union with the true silhouette

    def test_it_finds_the_person(self) -> None:
        """One silhouette per usable view that fits the person; nothing is changed."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        believed = moved(pose, np.full(6 + len(pose.angles), 0.01))
        frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed)
        past = scenes.tiny_past(scene, believed)
        found = assert_pure(segmentation_of, self.segmenter, frame, state, past, scene, TURN)
        persons = found.of("person")
        assert [silhouette.camera for silhouette in persons] == list(range(len(scene.cameras)))
        for silhouette, truth in zip(persons, pictures.tiny_masks(scene, pose), strict=True):
            inside = silhouette.distance > 0
            overlap = (inside & truth).sum() / (inside | truth).sum()
            assert overlap >= self.least_overlap, f"camera {silhouette.camera}: overlap {overlap:.2f}"

    def test_a_lost_view_has_no_silhouette(self) -> None:
        """A view that is not usable is left out."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        frame = pictures.without_view(pictures.tiny_frame(scene, pose), 1)
        state = pictures.tiny_state(scene, pose)
        found = self.segmenter.segment(frame, state, scenes.tiny_past(scene, pose), scene, TURN)
        assert 1 not in {silhouette.camera for silhouette in found.silhouettes}


class MatcherConformance(Conformance):
    """A matcher, with true silhouettes and a surface one centimetre off."""

    role = "matcher"
    matcher: Matcher

    def matches(self, clothed: bool, lost: int | None = None) -> Matches:
        """Return matches of a slightly wrong surface, looked at as in a run; one view is lost or none."""
        scene = scenes.tiny_scene(clothed=clothed)
        pose = scenes.tiny_pose(scene, 4)
        believed = moved(pose, np.full(6 + len(pose.angles), 0.01))
        surface = scene.surface(believed, scenes.tiny_cloth(scene, believed))
        frame, segmentation = pictures.tiny_frame(scene, pose), pictures.tiny_segmentation(scene, pose)
        if lost is not None:
            frame = pictures.without_view(frame, lost)
            segmentation = pictures.without_silhouette(segmentation, lost)
        past = scenes.tiny_past(scene, believed)
        return assert_pure(matches_of, self.matcher, frame, segmentation, surface, past, scene, TURN)  # type: ignore[no-any-return]

    @pytest.mark.parametrize("clothed", [False, True])
    def test_matches_point_at_something(self, clothed: bool) -> None:
        """Cameras, pixels and vertices exist, weights are not negative, directions are unit or zero."""
        length = np.linalg.norm(self.matches(clothed).direction, axis=1)
        assert (np.isclose(length, 1, atol=1e-6) | (length == 0)).all()

    @pytest.mark.parametrize("clothed", [False, True])
    def test_a_lost_view_has_no_matches(self, clothed: bool) -> None:
        """A view without a silhouette gives no matches."""
        assert 1 not in self.matches(clothed, lost=1).camera
