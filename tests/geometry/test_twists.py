"""T-GEO2: the exponential against the matrix exponential; logarithm, inverse, screws."""

import numpy as np
import pytest
from scipy.linalg import expm

from mocapflow.geometry import twists


def wedge(twist):
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = twists.hat(twist[:3]), twist[3:]
    return matrix


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 9.9e-5, 1.01e-4, 1e-2, 1.0, np.pi - 1e-9, np.pi, 6.0])
def test_exp_equals_matrix_exponential(size):
    rng = np.random.default_rng(3)
    for twist in rng.normal(size=(20, 6)):
        twist[:3] *= size / np.linalg.norm(twist[:3])
        np.testing.assert_allclose(twists.exp(twist), expm(wedge(twist)), atol=1e-12, rtol=0)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4, 0.5, 3.0, np.pi - 1e-6])
def test_log_inverts_exp(size):
    rng = np.random.default_rng(4)
    twist = rng.normal(size=(30, 6))
    twist[:, :3] *= size / np.linalg.norm(twist[:, :3], axis=1, keepdims=True)
    np.testing.assert_allclose(twists.log(twists.exp(twist)), twist, atol=1e-8)


def test_log_of_half_a_turn_keeps_the_rotation():
    axis = np.array([0.6, -0.8, 0.0])
    motion = twists.exp(np.append(np.pi * axis, [0.1, 0.2, 0.3]))
    np.testing.assert_allclose(twists.exp(twists.log(motion)), motion, atol=1e-12)


def test_inverse():
    motion = twists.exp(np.random.default_rng(6).normal(size=(5, 6)))
    np.testing.assert_allclose(motion @ twists.inverse(motion), np.broadcast_to(np.eye(4), (5, 4, 4)), atol=1e-14)


def test_screw_leaves_its_axis_and_has_no_pitch():
    axis, point = np.array([0.0, 0.6, 0.8]), np.array([0.3, -0.2, 1.1])
    screw = twists.screw(axis, point)
    assert abs(screw[:3] @ screw[3:]) < 1e-15
    moved = twists.exp(1.3 * screw) @ np.append(point + 0.4 * axis, 1.0)
    np.testing.assert_allclose(moved[:3], point + 0.4 * axis, atol=1e-15)


def test_hat_is_the_cross_product():
    a, b = np.random.default_rng(7).normal(size=(2, 8, 3))
    np.testing.assert_allclose((twists.hat(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)
