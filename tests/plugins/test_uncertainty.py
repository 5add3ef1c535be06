"""Standard deviations that mean something: what is added to those of the fit, and how it is found."""

import importlib.util
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from mocapflow_evaluation.tracked_motion import of_track
from mocapflow_export.uncertainty import DOUBTED, OUTLINE_MM, excess, measured, px_per_mm
from results_scene import demo_scene, stepping

from mocapflow.geometry import angles
from mocapflow.geometry.cameras import scaled
from mocapflow.geometry.kinematics import root_position

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "calibrate_uncertainty.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("calibrate_uncertainty", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def curves_of(script, errors, spread, size):
    """One curve for each row of errors (K, T) with deviations (K, T), the person at a size in px per mm."""
    rows = zip(errors, spread, strict=True)
    return [script.Curve(f"take {k}", *row, np.full(len(row[0]), size)) for k, row in enumerate(rows)]


def test_all_angles_of_a_frame_alike_and_the_track_keeps_the_covariance_of_the_fit():
    scene = demo_scene()
    track = stepping(scene.body, 5)
    formal = angles.measure(scene.body, track.root, track.angles, track.covariance, track.observed)
    stated = measured(track, scene)
    pelvis = of_track(track, scene).stick.places[:, 0]
    scale = excess(px_per_mm(pelvis, scene.cameras), OUTLINE_MM)
    np.testing.assert_allclose(stated.sd, scale[:, None] * formal.sd)
    np.testing.assert_array_equal(stated.value, formal.value)
    np.testing.assert_array_equal(stated.observed, formal.observed)


def test_what_images_contradict_is_less_sure():
    scene = demo_scene()
    track = stepping(scene.body, 5)
    stated = measured(replace(track, doubted=np.array([False, False, True, False, False])), scene)
    ratio = stated.sd / measured(track, scene).sd
    np.testing.assert_allclose(ratio, np.tile([[1], [1], [DOUBTED], [1], [1]], ratio.shape[1]))


def test_deviations_are_those_of_the_fit_widened_by_what_images_of_that_size_leave_open():
    scene = demo_scene()
    track = stepping(scene.body, 3)
    size = px_per_mm(root_position(scene.body, track.root), scene.cameras)
    fit = angles.measure(scene.body, track.root, track.angles, track.covariance).sd
    np.testing.assert_allclose(measured(track, scene).sd, (1 + OUTLINE_MM * size[:, None]) * fit)


def test_a_metre_is_shown_as_large_as_the_focal_length_over_the_distance():
    view = replace(demo_scene().cameras[0], camera_from_world=np.eye(4))
    focal = view.intrinsics[0, 0]
    assert px_per_mm(np.array([[0.3, 0.1, 2.0], [0.0, 0.0, 4.0]]), [view]) == pytest.approx([focal / 2e3, focal / 4e3])


def test_larger_images_tell_more_of_pixels_but_not_of_millimetres():
    size = np.array([1e-9, 0.2, 0.4, 1e9])  # px per mm; the deviations of the fit go with one over it
    assert excess(size, 5.0)[0] == pytest.approx(1.0)
    assert excess(size, 5.0)[1:3] == pytest.approx([2.0, 3.0])
    assert excess(size, 5.0)[3] / size[3] == pytest.approx(5.0)


def test_the_size_of_a_person_goes_with_that_of_the_images_and_is_that_of_most_views():
    cameras = demo_scene().cameras
    place = np.array([[0.0, 0.0, 0.9], [0.1, 0.0, 0.9]])
    size = px_per_mm(place, cameras)
    assert px_per_mm(place, [scaled(camera, 0.5) for camera in cameras]) == pytest.approx(0.5 * size, rel=0.01)
    turn = np.diag([-1.0, 1.0, -1.0, 1.0])  # the person stands behind it
    turned = replace(cameras[0], camera_from_world=turn @ cameras[0].camera_from_world)
    assert px_per_mm(place, [turned, *cameras[1:]]) == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize("true_mm", [3.0, 8.0])
def test_the_outline_is_found_again(script, true_mm):
    dice, size = np.random.default_rng(0), 0.36
    spread = dice.uniform(0.3, 3.0, (40, 300))
    errors = excess(size, true_mm) * spread * dice.normal(size=spread.shape)
    curves = curves_of(script, errors, spread, size)
    wider = NormalDist().inv_cdf(0.5 + script.WANTED / 2) / NormalDist().inv_cdf(0.95)  # than 90 % asks for
    found = script.fitted(curves)
    assert excess(size, found) == pytest.approx(wider * excess(size, true_mm), rel=0.02)
    lost = script.Curve("lost", np.full(300, 40.0), np.full(300, 1.0), np.full(300, size))
    assert script.fitted([*curves, lost]) == found
    assert "with 1 curves of lost limbs" in script.told([*curves, lost], lambda _: true_mm)


def test_over_how_many_frames_errors_hang_together(script):
    dice, kept = np.random.default_rng(1), np.exp(-1 / 11)
    errors = dice.normal(size=(640, 60))
    for frame in range(1, 60):
        errors[:, frame] = kept * errors[:, frame - 1] + np.sqrt(1 - kept**2) * errors[:, frame]
    assert script.correlation_frames(curves_of(script, errors, np.ones_like(errors), 0.36)) == pytest.approx(
        11, rel=0.25
    )


@pytest.mark.parametrize(("memory", "low"), [(0.1, 0.0), (1e9, 10.0)])
def test_curves_that_exact_deviations_cover_badly(script, memory, low):
    """Errors of their own in every frame: none; the same error all along: as many as lie outside."""
    assert script.low_by_chance([60] * 100, 0.90, memory).mean() == pytest.approx(low, abs=0.5)
