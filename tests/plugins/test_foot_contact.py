"""Feet on the floor: pulled where they are near it, let go where they are not, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_priors.foot_contact import FootContact, geman_mcclure
from mocapflow_priors.soles import lowest_points
from twist_fixtures import make_body, make_pose, make_scene

from mocapflow.data import NO_CLOTH, Moment, Past, Pose
from mocapflow.model import moved

FEET = ("joint3", "joint5")


def contact(height: float) -> FootContact:
    return FootContact(height_m=height, parts=FEET)


def earlier(pose: Pose) -> Past:
    return Past(moments=(Moment(time=0.0, pose=pose, cloth=NO_CLOTH),))


def test_a_foot_is_pulled_where_it_is_near_the_floor_and_let_go_where_it_is_not() -> None:
    scene, pose = make_scene(), make_pose(0)
    heights, _ = lowest_points(make_body(), pose, FEET)
    for off, pull in ((0.0005, 0.5), (-0.0005, -0.5), (0.2, 0.0)):
        found = contact(heights[0] - off).residual(pose, earlier(pose), scene)
        force = found.jacobian[0, 5] * found.error[0] / 1000  # along z, in standard deviations per mm
        assert force == pytest.approx(pull, abs=0.02)


def test_it_is_silent_in_the_first_frame() -> None:
    scene, pose = make_scene(), make_pose(0)
    assert contact(0.0).residual(pose, Past(), scene).error.shape == (0,)


def test_derivatives() -> None:
    scene, pose, step = make_scene(), make_pose(1), 1e-6
    prior, past = contact(float(lowest_points(make_body(), pose, FEET)[0][0]) - 0.003), earlier(pose)
    residual = prior.residual(pose, past, scene)
    errors = [[prior.residual(moved(pose, s * step * c), past, scene).error for s in (1, -1)] for c in np.eye(18)]
    numeric = np.stack([(ahead - behind) / (2 * step) for ahead, behind in errors], axis=1)
    np.testing.assert_allclose(residual.jacobian, numeric, atol=1e-5 * np.abs(numeric).max())


def test_the_residual_squared_is_geman_and_mcclures_loss() -> None:
    error = np.linspace(-20, 20, 41)
    found, slope = geman_mcclure(error, 4.0)
    np.testing.assert_allclose(found**2, error**2 * 16 / (error**2 + 16))
    np.testing.assert_allclose(slope, (geman_mcclure(error + 1e-6, 4.0)[0] - found) / 1e-6, atol=1e-6)
