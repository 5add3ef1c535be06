"""The functional: its terms, and steps that do not raise it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mocapflow_priors.rest_pose import RestPose

from mocapflow.data import FrameState, Matches, Past, Pose, Residual
from mocapflow.functional import SHAPE_WEIGHT, Functional, area, contours, halfway, image_cost, unique_names
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.model import increment_between, moved
from mocapflow.testing import pictures, scenes

SCENE = scenes.tiny_scene(clothed=True)
MODEL = scenes.tiny_model(SCENE)
POSE = scenes.tiny_pose(SCENE, 3)
CLOTH = scenes.tiny_cloth(SCENE, POSE)


def off(pose, shift):
    """Return the pose moved sideways by a shift in m."""
    increment = np.zeros(6 + len(pose.angles))
    increment[3] = shift
    return moved(pose, increment)


def test_area_is_the_squared_difference_of_the_distance_fields():
    surface, camera = SCENE.surface(POSE, CLOTH), SCENE.cameras[0]
    seen = pictures.tiny_segmentation(SCENE, POSE).silhouettes[0]
    model = model_distance(surface, camera, pictures.BAND)  # narrower than the functional's
    thin = replace(seen, distance=np.minimum(seen.distance, np.float32(2.0)))  # nowhere as deep inside as its band
    tight = replace(seen, distance=np.maximum(seen.distance, np.float32(-2.0)))  # nor outside
    for shown in (seen, thin, tight):
        squares = np.sum((model - shown.distance) ** 2)
        assert area(surface, shown, camera) == pytest.approx(SHAPE_WEIGHT * squares, rel=1e-4)


def test_contour_is_half_the_weighted_squared_error_along_the_direction_or_in_full():
    surface, camera = SCENE.surface(POSE, CLOTH), SCENE.cameras[1]
    pixel = project(surface.vertices[:2], camera) - [3.0, 4.0]
    matches = Matches(
        camera=np.array([1, 1], np.int16), pixel=pixel, direction=np.array([[1.0, 0.0], [0.0, 0.0]]),
        vertex=np.arange(2, dtype=np.int32), weight=np.array([2.0, 1.0]),
    )  # fmt: skip
    assert contours(surface, matches, [camera, camera]) == pytest.approx([0, 0.5 * (2 * 9 + 25)])


def test_every_view_has_its_terms_and_a_lost_one_none():
    functional, state = Functional(MODEL, (), Past()), pictures.tiny_state(SCENE, POSE)
    aside = pictures.tiny_state(SCENE, off(POSE, 0.05), POSE)
    values = dict(zip(functional.terms, functional.values(state), strict=True))
    assert set(values) == {f"cam0{c}.{term}" for c in (1, 2, 3, 4) for term in ("data", "length", "shape", "contour")}
    assert np.isnan(values["cam01.data"])  # these silhouettes are drawn, nothing was segmented
    assert 0 < values["cam01.shape"] < 0.1 * functional.values(aside)[functional.terms.index("cam01.shape")]
    lost = FrameState(**{**vars(state), "segmentation": pictures.without_silhouette(state.segmentation, 1)})
    values = dict(zip(functional.terms, functional.values(lost), strict=True))
    assert np.isnan(values["cam02.shape"]) and np.isfinite(values["cam01.shape"])


def test_a_pose_costs_its_areas_and_what_the_priors_say_times_their_weight():
    said = Residual(error=np.zeros(1), jacobian=np.zeros((1, 6 + len(POSE.angles))), energy=7.0)
    prior = SimpleNamespace(name="stern", weight=2.0, residual=lambda *given: said)
    seen = pictures.tiny_segmentation(SCENE, off(POSE, 0.02))
    with_prior, alone = (Functional(MODEL, priors, Past()).pose_cost(seen, POSE, CLOTH) for priors in ((prior,), ()))
    surface = MODEL.surface(POSE, CLOTH)
    assert alone == pytest.approx(sum(area(surface, one, SCENE.cameras[one.camera]) for one in seen.of("person")))
    assert with_prior - alone == pytest.approx(14.0)
    assert Functional(MODEL, (prior,), Past()).values(pictures.tiny_state(SCENE, POSE))[-1] == 14.0


def test_the_sum_is_of_all_terms_that_are_there_but_contours():
    functional = Functional(MODEL, (RestPose(weight=2.0),), Past())
    values = np.arange(17.0)
    values[4] = np.nan  # cam02 has no data
    assert functional.terms[-2:] == ("cam04.contour", "rest_pose")
    assert functional.total(values) == sum(range(17)) - 4 - (3 + 7 + 11 + 15)


@pytest.mark.parametrize(("shift", "halvings", "share"), [(0.01, 3, 1), (0.05, 3, 0.125), (0.05, 1, 0.5), (0.05, 0, 1)])
def test_a_step_that_raises_the_functional_is_halved(shift, halvings, share):
    """From the true pose 5 cm aside costs more however often it is halved; 1 cm towards it costs less."""
    begin = off(POSE, -shift) if shift == 0.01 else POSE
    state, target = pictures.tiny_state(SCENE, begin, POSE), off(begin, shift)
    forced = CLOTH.parameters + [0.2, 0, 0]
    estimate = replace(state.estimate, pose=target, parameters=forced)
    step, hung = Functional(MODEL, (), Past()).step, replace(scenes.tiny_cloth(SCENE, target), parameters=forced)
    reached, cloth = step(state, state.segmentation, estimate, hung, halvings)
    assert reached.parameters == pytest.approx(CLOTH.parameters + [0.2 * share, 0, 0])
    went = reached.pose.root[:3, 3] - begin.root[:3, 3]
    np.testing.assert_allclose(went, share * (target.root[:3, 3] - begin.root[:3, 3]), atol=1e-12)
    np.testing.assert_allclose(cloth.vertices, scenes.tiny_cloth(SCENE, reached.pose).vertices, atol=1e-9)


@pytest.mark.parametrize(("risen", "halved"), [(1.0, 0), (1.009, 0), (1.011, 1)])
def test_a_step_may_raise_the_functional_by_one_percent(monkeypatch, risen, halved):
    """What a step lowers is the error of contours, not this; half of the step is let pass here."""
    costs = iter([100.0, 100.0 * risen, 100.0])
    monkeypatch.setattr(Functional, "pose_cost", lambda *given: next(costs))
    state, target = pictures.tiny_state(SCENE, POSE), off(POSE, 0.02)
    estimate = replace(state.estimate, pose=target, parameters=CLOTH.parameters)
    step = Functional(MODEL, (), Past()).step
    reached, _ = step(state, state.segmentation, estimate, scenes.tiny_cloth(SCENE, target), 3)
    assert reached.pose.root[0, 3] - POSE.root[0, 3] == pytest.approx(0.02 / 2**halved)


def test_an_increment_leads_from_one_pose_to_another():
    step = np.random.default_rng(2).uniform(-1, 1, 6 + len(POSE.angles))
    np.testing.assert_allclose(increment_between(POSE, moved(POSE, step)), step, atol=1e-10)


def test_halfway_lies_in_the_middle():
    other = moved(POSE, np.random.default_rng(1).normal(size=6 + len(POSE.angles)))
    middle = halfway(POSE, other)
    np.testing.assert_allclose(middle.angles, (POSE.angles + other.angles) / 2)
    there = halfway(other, POSE)
    np.testing.assert_allclose(middle.root, there.root, atol=1e-12)
    assert isinstance(middle, Pose)


def test_two_priors_of_one_name_are_told_apart():
    assert unique_names(["parzen", "limits", "parzen", "parzen"]) == ("parzen", "limits", "parzen_2", "parzen_3")


def test_images_cost_what_the_last_turn_left_of_data_and_length():
    terms = ("cam01.data", "cam01.length", "cam02.data", "cam01.shape", "cam01.contour", "parzen")
    energy = np.array([[5.0] * 6, [4.0] * 6, [2.0, 1.0, np.nan, 4, 8, 16], [np.nan] * 6])
    assert image_cost(energy, terms) == 3
    assert image_cost(np.full((2, 6), np.nan), terms) == 0  # of a lost frame
