"""Standard deviations that mean something: the factor on those of the fit, and how it is found."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from mocapflow_sequence.uncertainty import FACTOR, measured
from results_scene import demo_scene, stepping

from mocapflow.geometry import angles

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "calibrate_uncertainty.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("calibrate_uncertainty", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_one_factor_for_all_angles_and_the_track_keeps_the_covariance_of_the_fit():
    scene = demo_scene()
    track = stepping(scene.body, 5)
    formal = angles.measure(scene.body, track.root, track.angles, track.covariance, track.observed)
    stated = measured(track, scene)
    np.testing.assert_allclose(stated.sd, FACTOR * formal.sd)
    np.testing.assert_array_equal(stated.value, formal.value)
    np.testing.assert_array_equal(stated.observed, formal.observed)


@pytest.mark.parametrize("true_factor", [1.5, 3.0])
def test_the_factor_is_found_again(script, true_factor):
    """Errors that are independent from frame to frame: then the share of all values decides, not that of a curve."""
    dice = np.random.default_rng(0)
    spread = dice.uniform(0.3, 3.0, (40, 300))
    errors = true_factor * spread * dice.normal(size=spread.shape)
    curves = [script.Curve(f"take {k}", *pair) for k, pair in enumerate(zip(errors, spread, strict=True))]
    assert script.fitted(curves) == pytest.approx(true_factor, rel=0.03)
    assert script.pooled(curves, true_factor) == pytest.approx(0.90, abs=0.01)
    lost = script.Curve("lost", np.full(300, 40.0), np.full(300, 1.0))
    assert script.fitted([*curves, lost]) == script.fitted(curves)
    assert "with 1 curves of lost limbs" in script.told([*curves, lost], true_factor)


def test_errors_that_hang_together_ask_for_more_than_their_size(script):
    """What a single curve covers scatters then, and nearly every curve is to be covered."""
    dice, kept = np.random.default_rng(1), np.exp(-1 / 11)
    errors = dice.normal(size=(640, 60))
    for frame in range(1, 60):
        errors[:, frame] = kept * errors[:, frame - 1] + np.sqrt(1 - kept**2) * errors[:, frame]
    curves = [script.Curve(f"take {k}", error, np.ones(60)) for k, error in enumerate(errors)]
    assert script.correlation_frames(curves) == pytest.approx(11, rel=0.2)
    assert 1.0 < script.fitted(curves) < 1.2
    assert 0.9 < script.pooled(curves, script.fitted(curves)) < 0.95
