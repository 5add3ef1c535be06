"""Image contours and nearest neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocapflow.geometry.contours import at_nearest, nearest_compatible, zero_crossings
from mocapflow.geometry.registration import rigid_motion
from mocapflow.records import F32


def disc(radius: float, x: float = 50.2, y: float = 40.7) -> F32:
    columns, rows = np.meshgrid(np.arange(100), np.arange(80))
    return np.clip(radius - np.hypot(columns - x, rows - y), -12, 12).astype(np.float32)


def test_the_contour_of_a_disc_lies_on_its_circle() -> None:
    pixel, normal = zero_crossings(disc(20.3), 3)
    radial = pixel - [50.2, 40.7]
    radius = np.linalg.norm(radial, axis=1)
    assert np.abs(radius - 20.3).max() < 0.02
    assert np.sum(radial * normal, axis=1) == pytest.approx(radius, rel=2e-3)
    assert len(radius) == pytest.approx(8 * 20.3, rel=0.02)
    assert (np.diff(pixel[:, 1]) >= 0).all()


def test_holes_and_several_components_are_all_found() -> None:
    ring = np.minimum(disc(30.0), -disc(15.0)).astype(np.float32)
    radius = np.linalg.norm(zero_crossings(ring, 3)[0] - [50.2, 40.7], axis=1)
    assert set(np.round(radius)) == {15.0, 30.0}


def test_a_contour_at_the_image_border_is_left_out() -> None:
    pixel, _ = zero_crossings(disc(60.0), 3)
    assert ((pixel >= 3) & (pixel <= [96, 76])).all()


def test_a_field_is_read_at_the_nearest_pixel_and_goes_on_beyond_its_edge() -> None:
    field = np.arange(12, dtype=np.float32).reshape(3, 4)
    places = np.array([[0.4, 0.0], [0.6, 1.4], [3.4, 2.4], [-7.0, 1.0], [9.0, 99.0]])
    np.testing.assert_array_equal(at_nearest(field, places), [0, 5, 11, 4, 11])


def test_nearest_neighbours_are_exact_and_agree_in_direction() -> None:
    rng = np.random.default_rng(3)
    points, others = rng.uniform(0, 50, (200, 2)), rng.uniform(0, 50, (300, 2))
    others = others[np.argsort(others[:, 1])]
    angles = rng.uniform(0, 2 * np.pi, 500)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    found = nearest_compatible(points, normals[:200], others, normals[200:], 3.0, 0.5)
    gaps = np.linalg.norm(points[:, None] - others, axis=2)
    gaps[(normals[:200] @ normals[200:].T < 0.5) | (gaps >= 3.0)] = np.inf
    expected = np.where(np.isfinite(gaps.min(1)), gaps.argmin(1), -1)
    assert (found == expected).all()
    assert (found == -1).any()


def test_icp_of_rigid_point_sets_never_gets_worse() -> None:
    """T-ICP1: exact neighbours and an exact fit each lower the matched cost, at every step."""
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(20):
        fixed = rng.uniform(0, 100, (60, 3))
        fixed = fixed[np.argsort(fixed[:, 1])]
        turn = Rotation.from_rotvec(rng.normal(0, 0.3, 3)).as_matrix()
        moving = (fixed - 50) @ turn.T + 50 + rng.normal(0, 8, 3)
        costs = []  # before and after each fit
        ones = np.tile([1.0, 0.0], (60, 1))
        for _ in range(15):
            target = fixed[nearest_compatible(moving, ones, fixed, ones, 1e3, -1.0)]
            costs.append(np.sum((moving - target) ** 2))
            rotation, shift = rigid_motion(moving, target)
            moving = moving @ rotation.T + shift
            costs.append(np.sum((moving - target) ** 2))
        assert (np.diff(costs) <= 1e-9 * costs[0]).all()
        found += costs[-1] < 1e-9 * costs[0]
    assert found >= 15  # 19 do: the turn is 17 degrees about each axis, the shift 8 of 100 (1 sigma)
