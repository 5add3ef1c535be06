"""Twists (omega, v), their exponentials and logarithms in SE(3).

Every function takes arrays with any leading axes. Source of the closed forms: Murray, Li, Sastry 1994, chapter 2.
"""

from __future__ import annotations

import math

import numpy as np

from mocapflow.records import F64

SMALL_ANGLE = 1e-4  # rad; below it series replace the quotients, which would cancel: two terms are exact to rounding


def hat(vector: F64) -> F64:
    """Return the matrix of the cross product, `hat(a) @ b == cross(a, b)`.

    Args:
        vector: (..., 3).

    Returns:
        (..., 3, 3).

    Source: Rosenhahn 2008, Eq. (12.4)
    """
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def _coefficients(angle: F64) -> tuple[F64, F64, F64]:
    """Return sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3, stable at zero."""
    small = angle < SMALL_ANGLE
    t = np.where(small, 1.0, angle)
    t2 = angle**2
    a = np.where(small, 1 - t2 / 6, np.sin(t) / t)
    b = np.where(small, 0.5 - t2 / 24, 0.5 * (np.sin(t / 2) / (t / 2)) ** 2)  # 1 - cos t would cancel
    c = np.where(small, 1 / 6 - t2 / 120, (t - np.sin(t)) / t**3)
    return a, b, c


def exp(twist: F64) -> F64:
    """Return the rigid motion that a twist generates: the exponential of its matrix [[hat(omega), v], [0, 0]].

    The equation gives the twist; the closed form is that of Murray, Li, Sastry.

    Args:
        twist: (..., 6) rad and m, (omega, v).

    Returns:
        (..., 4, 4).

    Source: Rosenhahn 2008, Eq. (12.6)
    """
    omega, v = twist[..., :3], twist[..., 3:]
    a, b, c = (q[..., None, None] for q in _coefficients(np.linalg.norm(omega, axis=-1)))
    w = hat(omega)
    w2 = w @ w
    motion = np.zeros((*twist.shape[:-1], 4, 4))
    motion[..., :3, :3] = np.eye(3) + a * w + b * w2
    motion[..., :3, 3] = ((np.eye(3) + b * w + c * w2) @ v[..., None])[..., 0]
    motion[..., 3, 3] = 1.0
    return motion


def log_rotation(rotation: F64) -> F64:
    """Return the rotation vector of a rotation, stable at zero and at pi.

    Args:
        rotation: (..., 3, 3).

    Returns:
        (..., 3) rad, of norm at most pi.
    """
    flat = np.asarray(rotation).reshape(-1, 3, 3)
    return np.array([_rotation_vector(one.tolist()) for one in flat]).reshape(rotation.shape[:-1])


def _rotation_vector(r: list[list[float]]) -> list[float]:
    """Return the rotation vector of one rotation through its quaternion, started from its largest component."""
    trace = r[0][0] + r[1][1] + r[2][2]
    i = max(range(3), key=lambda k: r[k][k])
    j, k = (i + 1) % 3, (i + 2) % 3
    vector = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]  # 4 w times the vector part
    if trace >= r[i][i]:
        w = 1.0 + trace  # 4 w^2
    else:
        w = vector[i]  # all times 4 times component i
        vector[i] = 1.0 + r[i][i] - r[j][j] - r[k][k]
        vector[j], vector[k] = r[i][j] + r[j][i], r[i][k] + r[k][i]
    sine = math.hypot(*vector)
    if sine == 0.0:
        return vector
    half = math.atan2(sine, abs(w)) * math.copysign(2.0, w) / sine
    return [half * component for component in vector]


def log(motion: F64) -> F64:
    """Return the twist of a rigid motion: the inverse of `exp` for angles up to pi.

    Args:
        motion: (..., 4, 4).

    Returns:
        (..., 6) rad and m.
    """
    omega = log_rotation(motion[..., :3, :3])
    _, b, c = (q[..., None, None] for q in _coefficients(np.linalg.norm(omega, axis=-1)))
    w = hat(omega)
    v = np.linalg.solve(np.eye(3) + b * w + c * (w @ w), motion[..., :3, 3:])[..., 0]
    return np.concatenate([omega, v], axis=-1)


def screw(axis: F64, point: F64) -> F64:
    """Return the zero-pitch twist that turns about an axis through a point.

    Args:
        axis: (..., 3) unit.
        point: (..., 3) m.

    Returns:
        (..., 6), with v = point x axis.
    """
    return np.concatenate([axis, np.cross(point, axis)], axis=-1)


def inverse(motion: F64) -> F64:
    """Return the inverse of rigid motions (..., 4, 4)."""
    out = np.zeros_like(motion)
    transposed = np.swapaxes(motion[..., :3, :3], -1, -2)
    out[..., :3, :3] = transposed
    out[..., :3, 3] = -(transposed @ motion[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out
