"""Between the rotation of a joint and the angles of its screws."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocapflow.assets import Body
from mocapflow.geometry import twists
from mocapflow.records import F64

LOCKED = 1e-7  # cosine of the middle angle below which the outer two turn about the same axis
SWEEPS = 60  # of coordinate ascent; the axes of a joint are close to orthogonal, so few are needed


def angles_from_rotations(body: Body, rotations: Mapping[str, F64]) -> F64:
    """Return the angles (D,) rad whose joints turn as given, as nearly as their screws allow.

    Args:
        body: the chain.
        rotations: rotation vectors (3,) rad relative to the parent, by joint name; joints left out stay at rest.

    Exact for three orthonormal screws; with one or two the nearest rotation (in the chordal distance).
    """
    angles = np.zeros(len(body.twists))
    for name, vector in rotations.items():
        screws = np.flatnonzero(body.screw_joint == body.joint(name))
        if len(screws):
            turn = np.append(np.asarray(vector, np.float64), np.zeros(3))
            angles[screws] = decompose(body.twists[screws, :3], twists.exp(turn)[:3, :3])
    return angles


def decompose(axes: F64, rotation: F64) -> F64:
    """Return the angles (K,) of turns about unit axes (K, 3), first axis outermost, that make up a rotation (3, 3)."""
    if len(axes) == 3 and np.allclose(axes @ axes.T, np.eye(3), atol=1e-9):
        return _davenport(axes, rotation)
    return _nearest(axes, rotation)


def _davenport(axes: F64, rotation: F64) -> F64:
    sign = np.sign(np.linalg.det(axes))
    basis = axes * np.array([1.0, 1.0, sign])[:, None]
    r = basis @ rotation @ basis.T  # = Rx(a) Ry(b) Rz(c)
    if np.hypot(r[0, 0], r[0, 1]) < LOCKED:
        return np.array([np.arctan2(r[2, 1], r[1, 1]), np.arcsin(np.clip(r[0, 2], -1, 1)), 0.0])
    b = np.arctan2(r[0, 2], np.hypot(r[0, 0], r[0, 1]))
    return np.array([np.arctan2(-r[1, 2], r[2, 2]), b, sign * np.arctan2(-r[0, 1], r[0, 0])])


def _nearest(axes: F64, rotation: F64) -> F64:
    """Turn one axis at a time to where trace(rotation^T product) is largest: closed form for each."""
    angles = np.zeros(len(axes))
    for _ in range(SWEEPS):
        before = angles.copy()
        for k, axis in enumerate(axes):
            left, right = _product(axes[:k], angles[:k]), _product(axes[k + 1 :], angles[k + 1 :])
            q = left.T @ rotation @ right.T
            sine = axis @ np.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]])
            angles[k] = np.arctan2(sine, np.trace(q) - axis @ q @ axis)
        if np.abs(angles - before).max() < 1e-12:
            break
    return angles


def _product(axes: F64, angles: F64) -> F64:
    product = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        product = product @ twists.exp(np.append(angle * axis, np.zeros(3)))[:3, :3]
    return product
