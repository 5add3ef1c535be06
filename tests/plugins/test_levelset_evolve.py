"""Convergence (T-LS4) and the pull of the shape prior (T-LS6) on scenes with a known outline."""

import numpy as np
import pytest
from levelset_scenes import descend, ellipse, overlap, ramp_scene
from mocapflow_levelset import evolve

LAMBDAS = (0.0, 0.01, 0.03, 0.05, 0.1, 0.3, 1.0)
SPECIFIED = {  # IoU after 40 iterations with the prior 3 px off, one column per lambda
    "clean": (0.996, 0.996, 0.995, 0.994, 0.989, 0.947, 0.911),
    "occluder": (0.846, 0.860, 0.865, 0.884, 0.945, 0.938, 0.909),
    "replaced": (0.913, 0.909, 0.906, 0.904, 0.903, 0.905, 0.905),
}


def test_from_a_circle_inside():
    planes, mask = ramp_scene()
    start = ellipse(a=30, b=30)
    assert overlap(descend(planes, start, start, 200), mask) >= 0.95


def test_from_three_pixels_off():
    planes, mask = ramp_scene()
    start = ellipse(x=83)
    assert overlap(descend(planes, start, start, 25), mask) >= 0.99


@pytest.mark.parametrize("disturbance", SPECIFIED)
def test_the_table_of_the_shape_prior(disturbance):
    planes, mask = ramp_scene(disturbance)
    prior = ellipse(x=83)
    found = np.array([overlap(descend(planes, prior, prior, 40, weight), mask) for weight in LAMBDAS])
    specified = np.array(SPECIFIED[disturbance])
    np.testing.assert_allclose(found, specified, atol=0.03)
    for worse in range(len(LAMBDAS)):
        for better in range(len(LAMBDAS)):
            if specified[better] - specified[worse] > 0.01:
                assert found[better] > found[worse], (LAMBDAS[better], LAMBDAS[worse])


def test_the_pull_grows_with_lambda():
    planes, _ = ramp_scene()
    prior = ellipse(x=83)
    near = np.abs(prior) < 0.5
    away = [np.abs(descend(planes, prior, prior, 40, weight)[near]).mean() for weight in LAMBDAS]
    assert (np.diff(away) < 0.01).all()
    assert away[0] > 1.2 and away[-1] < 0.6


def test_a_median_filter_helps_where_most_pixels_are_replaced():
    cv2 = pytest.importorskip("cv2")
    planes, mask = ramp_scene("replaced")
    prior = ellipse(x=83)
    filtered = np.stack([cv2.medianBlur((plane * 255).astype(np.uint8), 9) for plane in planes]) / np.float32(255)
    plain = overlap(descend(planes, prior, prior, 40, 0.05), mask)
    robust = overlap(descend(filtered.astype(np.float32), prior, prior, 40, 0.05), mask)
    assert robust > plain + 0.02


@pytest.mark.parametrize(("start", "least", "most"), [(ellipse(), 4, 20), (ellipse(a=30, b=30), 28, 199)])
def test_a_descent_to_rest_takes_as_many_steps_as_its_way_needs(start, least, most, monkeypatch):
    planes, mask = ramp_scene()
    whole, steps, step = descend(planes, start, start, 200, every=4), [], evolve.advance
    monkeypatch.setattr(evolve, "advance", lambda *given: (steps.append(1), step(*given)))
    found = descend(planes, start, start, 200, every=4, to_rest=True)
    assert overlap(found, mask) > overlap(whole, mask) - 0.01
    assert least <= len(steps) <= most
