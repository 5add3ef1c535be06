"""T-GEO1: the error of a point against a ray is its perpendicular distance, to 1e-12."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from mocapflow.geometry import cameras, lines
from tests.fixtures.recordings import look_at


def scene(count=200, seed=5):
    rng = np.random.default_rng(seed)
    view = look_at("a", np.array([3.0, -2.0, 1.7]), size=(1088, 1920), focal=1680.0)
    rays = lines.through(rng.uniform([0, 0], [1087, 1919], size=(count, 2)), view)
    return view, rays, rng.normal(size=(count, 3))


def test_error_is_the_distance_by_elimination():
    view, rays, points = scene()
    offset = points - cameras.centre(view)
    direction = rays[:, :3]
    across = offset - np.sum(offset * direction, axis=1, keepdims=True) * direction
    distance = np.linalg.norm(lines.error(points, rays), axis=1)
    assert np.abs(distance - np.linalg.norm(across, axis=1)).max() < 1e-12


def test_error_is_the_distance_by_search():
    view, rays, points = scene(20)
    centre = cameras.centre(view)
    for ray, point in zip(rays, points, strict=True):
        found = minimize_scalar(lambda s, r=ray, p=point: np.sum((centre + s * r[:3] - p) ** 2), tol=1e-14)
        assert np.linalg.norm(lines.error(point[None], ray[None])) == pytest.approx(np.sqrt(found.fun), abs=1e-7)


def test_points_of_the_ray_have_no_error_and_errors_are_across():
    view, rays, points = scene()
    on = cameras.centre(view) + np.linspace(0.1, 9, len(rays))[:, None] * rays[:, :3]
    assert np.abs(lines.error(on, rays)).max() < 1e-12
    assert np.abs(np.sum(lines.error(points, rays) * rays[:, :3], axis=1)).max() < 1e-12


def test_lines_are_normalised_and_moments_across():
    _, rays, _ = scene()
    assert np.abs(np.linalg.norm(rays[:, :3], axis=1) - 1).max() < 1e-14
    assert np.abs(np.sum(rays[:, :3] * rays[:, 3:], axis=1)).max() < 1e-13


def test_the_error_is_as_long_as_the_way_across_to_the_ray():
    view, rays, points = scene()
    from_centre = points - cameras.centre(view)
    along = np.sum(from_centre * rays[:, :3], axis=1, keepdims=True) * rays[:, :3]
    distance = np.linalg.norm(lines.error(points, rays), axis=1)
    assert np.abs(np.linalg.norm(from_centre - along, axis=1) - distance).max() < 1e-12
