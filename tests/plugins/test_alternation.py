"""Segmentation and pose each lower the area (T-SYS1), the log has every term and a known pose is found (T-SYS2)."""

from dataclasses import replace

import numpy as np
import pytest
from matching_scenes import FRAME as BLANK
from matching_scenes import Given, seen, start_near
from mocapflow_draping.fixed import Fixed
from mocapflow_levelset.levelset import LevelSet
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow.data import Past, Turn
from mocapflow.functional import Functional
from mocapflow.geometry.kinematics import root_position
from mocapflow.loop import Steps, settle
from mocapflow.model import increment_between, moved
from mocapflow.prediction import initial_state
from mocapflow.steady import Steady
from mocapflow.testing import pictures, scenes

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
        FRAME, initial_state(START, cloth.parameters, cloth), Past(), steps, MODEL, lambda *news: states.append(news[2])
    )
    return result, states


def test_the_pose_step_lowers_the_area_at_a_fixed_silhouette(settled):
    _, states = settled
    functional = Functional(MODEL, (), Past())
    before = functional.pose_cost(states[0].segmentation, START, scenes.tiny_cloth(SCENE, START))
    after = functional.pose_cost(states[0].segmentation, states[0].estimate.pose, states[0].cloth)
    assert after < 0.5 * before


def test_segmentation_lowers_the_area_at_a_fixed_pose():
    """From silhouettes that are 2 cm off, where the images agree with the model."""
    functional, state = Functional(MODEL, (), Past()), pictures.tiny_state(SCENE, TRUTH, START)
    found = LevelSet().segment(FRAME, state, Past(), SCENE, Turn(index=1))
    before, after = (functional.pose_cost(each, TRUTH, state.cloth) for each in (state.segmentation, found))
    assert after < 0.5 * before


def test_the_log_has_every_term_of_every_turn(settled):
    """T-SYS2."""
    result, states = settled
    assert result.steady
    assert result.energy_terms[:4] == ("cam01.data", "cam01.length", "cam01.shape", "cam01.contour")
    assert np.isfinite(result.energy).all(axis=1).tolist() == [True] * len(states) + [False] * (8 - len(states))


def found_from_five_degrees_off(seed, segmenter):
    """Return by how much the turn of the root and all angles (K,) deg, and its place (mm), are off in the end."""
    matcher = ContourIcp(hem_guard_px=0, cloth_sigma_px_per_m=0)  # the garment hangs as it is believed to
    steps = Steps(
        segmenter=segmenter, matchers=[matcher], pose_solver=TwistGaussNewton(), cloth_fitter=Fixed(), priors=(),
        steady=Steady(turns=1),
    )  # fmt: skip
    truth = scenes.tiny_pose(SCENE, seed + 100)
    start = start_near(truth, 5.0, 0.007, seed)
    cloth = scenes.tiny_cloth(SCENE, start)
    initial = initial_state(start, cloth.parameters, cloth)
    shown, picture = seen(SCENE.surface(truth, scenes.tiny_cloth(SCENE, truth)), SCENE), BLANK
    if not isinstance(segmenter, Given):
        shown, picture = initial.segmentation, pictures.tiny_frame(SCENE, truth, seed)
    state = replace(initial, segmentation=shown)
    found = settle(picture, state, Past(), steps, MODEL, lambda *_: None).state.estimate.pose
    off = np.abs(increment_between(truth, found))[[0, 1, 2, *range(6, 6 + len(truth.angles))]]
    places = [root_position(SCENE.body, pose.root) for pose in (found, truth)]
    return np.degrees(off), 1000 * np.linalg.norm(np.subtract(*places))


def test_a_known_pose_is_found_under_the_true_garment():
    """T-SYS2: by exact silhouettes; half of all angles to half a degree, the root to a fifth of a pixel of 7.5 mm."""
    off, away = zip(*(found_from_five_degrees_off(seed, Given()) for seed in range(6)), strict=True)
    assert np.median(off) < 0.5
    assert np.median(off, axis=1).max() < 1.0
    assert max(away) < 1.5  # mm; 0.1 but for one of 0.9


@pytest.mark.parametrize("seed", [0, 1])
def test_a_known_pose_is_found_in_pictures(seed):
    """T-SYS2: by the level set, from starts 5 degrees and less than 20 mm off, as a first pose is given by hand."""
    off, away = found_from_five_degrees_off(seed, LevelSet())
    assert np.median(off) < 0.5
    assert away < 2.0  # mm; 1.2 and 1.4


def test_terms_are_those_of_the_state(settled):
    result, states = settled
    values = Functional(MODEL, (), Past()).values(states[-1])
    np.testing.assert_array_equal(values, result.energy[len(states) - 1])
