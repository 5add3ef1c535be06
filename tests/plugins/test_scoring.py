"""How well poses of a clothed person agree with trimaps."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_recovery.disagreement import FLYING, HANGING
from mocapflow_recovery.scoring import Mismatch, Scorer, StartPose, drapes, mismatch_of
from mocapflow_recovery.trimaps import small_rooms, trimaps

from mocapflow.data import NO_CLOTH, Past, Pose
from mocapflow.model import ClothedModel
from mocapflow.testing import pictures, recovery, scenes

BARE, CLOTHED = scenes.tiny_scene(), scenes.tiny_scene(clothed=True)
POSE = scenes.tiny_pose(BARE, 3, 0.1)
LOOKED = trimaps(  # of somebody without a garment
    pictures.tiny_frame(BARE, POSE), BARE.surface(POSE, NO_CLOTH), small_rooms(BARE.background, BARE.cameras), 0.35
)
CALM = CLOTHED.neutral_parameters


class Swinging(scenes.Rigid):
    """The tube goes sideways with the sum of all angles."""

    def drape(self, poses, parameters, past, scene):
        return super().drape(poses, parameters, past, scene) + poses.angles.sum(axis=1)[:, None, None]


def scorer(start=None, cloth_weight=HANGING, parameters=CALM, coarse=CLOTHED) -> Scorer:
    return Scorer(scenes.tiny_model(CLOTHED), coarse, LOOKED, parameters, Past(), start, cloth_weight)


def test_cloth_in_empty_space_is_no_skin() -> None:
    surface = CLOTHED.surface(POSE, scenes.tiny_cloth(CLOTHED, POSE))
    clothed = mismatch_of(surface, CLOTHED, LOOKED)
    assert clothed.floating == mismatch_of(BARE.surface(POSE, NO_CLOTH), BARE, LOOKED).floating
    assert scorer(cloth_weight=FLYING).distances([POSE]) < 0.9 * scorer().distances([POSE])
    assert scorer(parameters=CALM + [0, 0.4, 0]).distances([POSE]) > scorer().distances([POSE])  # blown off


def test_what_is_uncovered_lies_farther_off_than_a_hint_and_not_near_the_garment() -> None:
    root = POSE.root.copy()
    root[0, 3] += 0.15
    beside = Pose(root=root, angles=POSE.angles)
    bare = mismatch_of(BARE.surface(beside, NO_CLOTH), BARE, LOOKED)
    clothed = mismatch_of(CLOTHED.surface(beside, scenes.tiny_cloth(CLOTHED, beside)), CLOTHED, LOOKED)
    assert bare.hint > bare.uncovered > 0 and 0 < clothed.uncovered < 0.4 * bare.uncovered


def test_cloth_off_the_model_is_no_contradiction() -> None:
    assert Mismatch(uncovered=1.0, floating=2.0, cloth=4.0, hint=8.0).area == 3.0


def test_a_pose_far_from_the_start_counts_as_farther_from_the_person() -> None:
    given = StartPose(POSE, np.radians(6))
    far = Pose(root=POSE.root, angles=POSE.angles + np.radians(6))
    free, held = (scorer(start).distances([POSE, far]) for start in (None, given))
    assert held == pytest.approx(free * [1.0, 2.0])


def test_a_result_is_scored_by_its_whole_surface() -> None:
    bent = Pose(root=POSE.root, angles=POSE.angles + 0.3)
    result = recovery.settled(pictures.tiny_state(CLOTHED, bent), CLOTHED)
    fit = scorer(coarse=None).score(result)
    assert fit.result is result and fit.distance > 0 and fit.mismatch.area > 0


def test_each_pose_has_its_own_drape_also_where_some_are_alike() -> None:
    model = ClothedModel(scene=CLOTHED, draper=Swinging())
    roots, angles = (np.eye(4), POSE.root), (POSE.angles + 0.1, POSE.angles)
    poses = [Pose(root=roots[k], angles=angles[j]) for k, j in ((0, 0), (1, 0), (1, 1), (0, 0), (0, 1))]
    for pose, cloth in zip(poses, drapes(model, poses, CALM, Past()), strict=True):
        np.testing.assert_allclose(cloth.vertices, model.drape(pose, CALM, Past()).vertices, atol=1e-12)
        np.testing.assert_array_equal(cloth.parameters, CALM)


def test_nobody_without_a_garment_is_draped() -> None:
    assert drapes(ClothedModel(scene=BARE, draper=scenes.Rigid()), [POSE] * 2, np.empty(0), Past()) == [NO_CLOTH] * 2
