"""What is said of a frame without a look at it."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.data import UNKNOWN, Cloth, Frame, Past
from mocapflow.loop import Steps
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state, lost, notes_on, seen
from mocapflow.steady import Steady
from mocapflow.testing import tiny_pose, tiny_scene


def frame(*usable):
    image = np.zeros((240, 320, 3), np.uint8)
    return Frame(index=7, time=0.2, images=(image,) * len(usable), usable=np.array(usable))


@pytest.mark.parametrize(
    ("usable", "enough"),
    [
        ((True,), True),
        ((False,), False),
        ((True, True), True),
        ((True, False), False),
        ((True, False, True), True),
        ((False, False, True, False), False),
    ],
)
def test_two_views_fix_a_pose_or_the_only_one_there_is(usable, enough):
    assert seen(frame(*usable)) is enough


def test_a_lost_frame_keeps_what_was_believed_and_says_which_views_were_missing():
    scene = tiny_scene(cameras=2)
    begun = initial_state(tiny_pose(scene), np.zeros(1), Cloth(vertices=np.zeros((3, 3)), parameters=np.zeros(1)))
    np.testing.assert_array_equal(begun.estimate.covariance, UNKNOWN * np.eye(7 + len(begun.estimate.pose.angles)))
    assert not begun.estimate.observed.any() and not begun.segmentation.silhouettes and not len(begun.matches.weight)
    steady = Steady(max_turns=3)
    steps = Steps(segmenter=None, matchers=(), pose_solver=None, cloth_fitter=None, priors=(), steady=steady)
    result = lost(frame(True, False), begun, steps, ClothedModel(scene=scene))
    assert result.state is begun
    assert (result.iterations, result.steady, result.oscillating) == (0, False, False)
    assert result.energy.shape == (3, len(result.energy_terms)) and np.isnan(result.energy).all()
    assert np.isnan(result.overlap).tolist() == [True, True]
    assert notes_on(frame(True, False), scene, Past(), result) == [
        "cam02 not usable: no image", "lost, fewer than 2 views; the prediction is kept",
    ]  # fmt: skip


def test_which_view_is_missing_is_said_also_of_a_frame_that_was_seen():
    scene = tiny_scene(cameras=3)
    begun = initial_state(tiny_pose(scene), np.zeros(0), Cloth(vertices=np.zeros((0, 3)), parameters=np.zeros(0)))
    steps = Steps(segmenter=None, matchers=(), pose_solver=None, cloth_fitter=None, priors=(), steady=Steady())
    unseen = lost(frame(True, True, True), begun, steps, ClothedModel(scene=scene))
    observed = np.ones(len(begun.estimate.observed))
    shown = replace(unseen, state=replace(begun, estimate=replace(begun.estimate, observed=observed)))
    torn = replace(frame(True, False, True), reasons=("", "torn", ""))
    missing = "cam02 not usable: torn"
    assert notes_on(torn, scene, Past(), shown) == [missing]
    assert notes_on(torn, scene, Past(), unseen) == [missing, "no view shows the person; the prediction is kept"]
    anew = "begun anew, like a first frame: the frames before do not show the person"
    assert notes_on(torn, scene, Past(after_gap=True), shown) == [missing, anew]
