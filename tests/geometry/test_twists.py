"""T-GEO2: the exponential against the matrix exponential; logarithm, inverse, the group, screws."""

import numpy as np
import pytest
from scipy.linalg import expm

from mocapflow.geometry import twists


def wedge(twist):
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = twists.hat(twist[:3]), twist[3:]
    return matrix


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 9.9e-5, 1.01e-4, 3e-4, 1e-2, 1.0, np.pi - 1e-9, np.pi, 6.0])
def test_exp_equals_matrix_exponential(size):
    rng = np.random.default_rng(3)
    for twist in rng.normal(size=(20, 6)):
        twist[:3] *= size / np.linalg.norm(twist[:3])
        np.testing.assert_allclose(twists.exp(twist), expm(wedge(twist)), atol=1e-14, rtol=0)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4, 0.5, 3.0, np.pi - 1e-6])
def test_log_inverts_exp(size):
    rng = np.random.default_rng(4)
    twist = rng.normal(size=(30, 6))
    twist[:, :3] *= size / np.linalg.norm(twist[:, :3], axis=1, keepdims=True)
    np.testing.assert_allclose(twists.log(twists.exp(twist)), twist, atol=1e-8)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-6, 9.9e-5, 1.01e-4, 1e-2, 1.0, 3.0, 3.14159, np.pi])
def test_exp_inverts_log(size):
    """T-GEO2: at half a turn, too, where the axis may come back reversed."""
    rng = np.random.default_rng(5)
    twist = rng.normal(size=(30, 6))
    twist[:, :3] *= size / np.linalg.norm(twist[:, :3], axis=1, keepdims=True)
    motion = expm(np.array([wedge(one) for one in twist]))
    np.testing.assert_allclose(twists.exp(twists.log(motion)), motion, atol=1e-12, rtol=0)


@pytest.mark.parametrize("axis", np.eye(3))
def test_log_of_half_a_turn_about_a_coordinate_axis(axis):
    """T-GEO2: the quaternion has one component alone, from which the others cannot be divided out."""
    np.testing.assert_allclose(twists.log_rotation(2 * np.outer(axis, axis) - np.eye(3)), np.pi * axis, atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-6, 9.9e-5, 1.01e-4, 1e-2, 1.0, 3.14159])
def test_motions_are_a_group(size):
    """T-GEO2: about one screw angles add up; back is the inverse; what follows each other is rigid, however grouped."""
    rng = np.random.default_rng(6)
    turn, shift = rng.normal(size=(2, 3, 20, 3))
    unit = [part / np.linalg.norm(part, axis=-1, keepdims=True) for part in (turn, shift)]
    twist = np.concatenate([size * unit[0], unit[1]], axis=-1)
    a, b, c = motion = twists.exp(twist)
    close = dict(atol=1e-12, rtol=0)
    np.testing.assert_allclose(twists.exp(0.3 * twist) @ twists.exp(0.7 * twist), motion, **close)
    np.testing.assert_allclose(twists.exp(-twist), twists.inverse(motion), **close)
    np.testing.assert_array_equal(twists.log(motion)[1], twists.log(b))  # with any leading axes
    both = twists.exp(twists.log(a @ b))
    np.testing.assert_allclose(both @ c, twists.exp(twists.log(a @ twists.exp(twists.log(b @ c)))), **close)
    rotation = both[:, :3, :3]
    np.testing.assert_allclose(rotation @ rotation.swapaxes(1, 2), np.broadcast_to(np.eye(3), (20, 3, 3)), **close)
    np.testing.assert_allclose(np.linalg.det(rotation), 1, **close)


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
