"""Segmentation and pose each lower the area between model and silhouette (T-SYS1), and the log has every term."""

import numpy as np
import pytest
from mocapflow_draping.fixed import Fixed
from mocapflow_levelset.levelset import LevelSet
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_twist.solver import TwistGaussNewton

from mocapflow.data import Past, Turn
from mocapflow.functional import Functional
from mocapflow.loop import Steps, settle
from mocapflow.model import moved
from mocapflow.steady import Steady
from mocapflow.testing import pictures, scenes
from mocapflow.track import believed

SCENE = scenes.tiny_scene(clothed=True)
MODEL = scenes.tiny_model(SCENE)
TRUTH = scenes.tiny_pose(SCENE, 3, 0.1)
START = moved(TRUTH, np.full(6 + len(TRUTH.angles), 0.02))
FRAME = pictures.tiny_frame(SCENE, TRUTH)


@pytest.fixture(scope="module")
def settled():
    """The frame settled from 2 cm and 1 degree aside."""
    steps = Steps(
        segmenter=LevelSet(), matchers=(ContourIcp(),),
        pose_solver=TwistGaussNewton(stop_sigmas=0.1),  # smaller steps are those of matches that change
        cloth_fitter=Fixed(), priors=(),
        steady=Steady(surface_mm=2.0, angle_deg=0.3, turns=1),
    )  # fmt: skip
    cloth = scenes.tiny_cloth(SCENE, START)
    states = []
    result = settle(
        FRAME, believed(START, cloth.parameters, cloth), Past(), steps, MODEL, lambda *news: states.append(news[2])
    )
    return result, states


def test_the_pose_step_lowers_the_area_at_a_fixed_silhouette(settled):
    _, states = settled
    functional = Functional(MODEL, (), Past())
    before = functional.pull(states[0].segmentation, START, scenes.tiny_cloth(SCENE, START))
    after = functional.pull(states[0].segmentation, states[0].estimate.pose, states[0].cloth)
    assert after < 0.5 * before


def test_segmentation_lowers_the_area_at_a_fixed_pose():
    """From silhouettes that are 2 cm off, where the images agree with the model."""
    functional, state = Functional(MODEL, (), Past()), pictures.tiny_state(SCENE, TRUTH, START)
    found = LevelSet().segment(FRAME, state, Past(), SCENE, Turn(index=1, cap=8))
    before, after = (functional.pull(each, TRUTH, state.cloth) for each in (state.segmentation, found))
    assert after < 0.5 * before


def test_the_log_has_every_term_of_every_turn(settled):
    result, states = settled
    assert result.steady
    assert result.energy_terms[:4] == ("cam01.data", "cam01.length", "cam01.shape", "cam01.contour")
    assert np.isfinite(result.energy).all(axis=1).tolist() == [True] * len(states) + [False] * (8 - len(states))


def test_terms_are_those_of_the_state(settled):
    result, states = settled
    surface = MODEL.surface(states[-1].estimate.pose, states[-1].cloth)
    values = Functional(MODEL, (), Past()).values(states[-1], surface)
    np.testing.assert_array_equal(values, result.energy[len(states) - 1])
