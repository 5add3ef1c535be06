"""Rows and normal equations against projection, Plücker lines and finite differences (T-GEO1, T-GEO3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_twist import normal_equations
from mocapflow_twist.constraint import Rows, image_rows, line_rows
from mocapflow_twist.steps import about_origin
from twist_fixtures import exact_matches, make_pose, make_scene

from mocapflow.data import Matches, Pose
from mocapflow.geometry import cameras, kinematics, lines
from mocapflow.model import moved
from mocapflow.scene import Scene

TIGHT = 1e-7  # of the largest entry


def noisy_matches(scene: Scene, pose: Pose, directed: bool, vertices: np.ndarray) -> Matches:
    rng = np.random.default_rng(5)
    matches = exact_matches(scene, pose, vertices, directed)
    noise = rng.normal(size=matches.pixel.shape) * 20
    return replace(matches, pixel=matches.pixel + noise, weight=rng.uniform(0.5, 2, len(noise)))


def make_rows(kind: str, matches: Matches, scene: Scene) -> Rows:
    return line_rows(matches, scene.cameras, 0.01) if kind == "line" else image_rows(matches, scene.cameras)


def points_of(scene: Scene, pose: Pose, rows: Rows) -> np.ndarray:
    return kinematics.skin(scene.body, kinematics.chain(scene.body, pose)[0], pose.angles)[rows.vertex]


def numeric_jacobian(scene: Scene, pose: Pose, rows: Rows) -> np.ndarray:
    """Central differences of the errors for increments about the root."""
    columns = about_origin(kinematics.root_position(scene.body, pose.root), 6 + len(pose.angles)).T

    def errors(increment: np.ndarray) -> np.ndarray:
        return normal_equations.point_errors(rows, points_of(scene, moved(pose, increment), rows))[0]

    step = 1e-5
    return np.stack([(errors(step * c) - errors(-step * c)) / (2 * step) for c in columns], axis=1)


def equations_of(scene: Scene, pose: Pose, rows: Rows) -> normal_equations.Equations:
    return normal_equations.body_equations(rows, scene.body, pose)


def test_image_rows_are_distances_in_the_image() -> None:
    scene, pose = make_scene(), make_pose(0)
    vertices = np.arange(0, 300, 7)
    for directed in (True, False):
        matches = noisy_matches(scene, pose, directed, vertices)
        rows = image_rows(matches, scene.cameras)
        error, _ = normal_equations.point_errors(rows, points_of(scene, pose, rows))
        seen = np.concatenate(
            [cameras.project(points_of(scene, pose, rows)[: len(vertices)], c) for c in scene.cameras]
        )
        offset = seen - matches.pixel
        expected = np.sum(offset * matches.direction, axis=1) if directed else np.concatenate([*offset.T])
        assert np.abs(error - expected).max() < 1e-9


def test_a_direction_along_an_axis_of_the_image_is_one() -> None:
    scene, vertices = make_scene(), np.arange(0, 300, 30)
    matches = noisy_matches(scene, make_pose(0), True, vertices)
    along = replace(matches, direction=np.eye(2)[np.arange(len(matches.camera)) % 2])
    rows = image_rows(along, scene.cameras)
    assert rows.match.tolist() == list(range(len(matches.camera)))
    error, _ = normal_equations.point_errors(rows, points_of(scene, make_pose(0), rows))
    seen = cameras.project_each(points_of(scene, make_pose(0), rows), along.camera, scene.cameras)
    np.testing.assert_allclose(error, np.sum((seen - along.pixel) * along.direction, axis=1), atol=1e-9)


def test_line_rows_are_the_chapters_error_vectors() -> None:
    scene, pose = make_scene(), make_pose(0)
    matches = noisy_matches(scene, pose, False, np.arange(0, 300, 7))
    rows = line_rows(matches, scene.cameras, 0.01)
    error, _ = normal_equations.point_errors(rows, points_of(scene, pose, rows))
    points = points_of(scene, pose, rows)[::3]
    rays = np.concatenate(
        [lines.through(matches.pixel[matches.camera == c], scene.cameras[c]) for c in range(len(scene.cameras))]
    )
    assert np.abs(error.reshape(-1, 3) - lines.error(points, rays)).max() < 1e-12


@pytest.mark.parametrize("kind", ["image", "directed", "line"])
@pytest.mark.parametrize("seed", range(3))
def test_normal_equations_are_those_of_the_numeric_jacobian(kind: str, seed: int) -> None:
    scene, pose = make_scene(seed), make_pose(seed, angle=0.6)
    rows = make_rows(kind, noisy_matches(scene, pose, kind == "directed", np.arange(300)), scene)
    error, _ = normal_equations.point_errors(rows, points_of(scene, pose, rows))
    jacobian = numeric_jacobian(scene, pose, rows)
    weighted = rows.weight[:, None] * jacobian
    equations = equations_of(scene, pose, rows)
    assert np.abs(equations.hessian - weighted.T @ jacobian).max() < TIGHT * np.abs(equations.hessian).max()
    assert np.abs(equations.gradient - weighted.T @ error).max() < TIGHT * np.abs(equations.gradient).max()
    assert equations.energy == pytest.approx(0.5 * rows.weight @ error**2, rel=1e-12)
    assert normal_equations.body_energy(rows, scene.body, pose) == pytest.approx(equations.energy, rel=1e-12)


@pytest.mark.parametrize("vertex", range(8))
def test_every_single_row_has_the_numeric_derivative(vertex: int) -> None:
    scene, pose = make_scene(), make_pose(3)
    matches = noisy_matches(scene, pose, True, np.array([vertex]))
    rows = image_rows(matches, scene.cameras)
    one = rows.part(np.arange(len(rows.vertex)) == 2, np.ones(len(rows.vertex)))
    error, _ = normal_equations.point_errors(one, points_of(scene, pose, one))
    row = equations_of(scene, pose, one).gradient / error
    numeric = numeric_jacobian(scene, pose, one)[0]
    assert np.abs(row - numeric).max() < TIGHT * np.abs(numeric).max()


def test_a_match_has_the_rank_of_what_it_measures() -> None:
    scene, pose = make_scene(), make_pose(0)
    one = noisy_matches(scene, pose, False, np.array([4]))
    for kind, directed, rank in (("image", True, 1), ("image", False, 2), ("line", False, 2)):
        matches = replace(one, direction=np.tile([0.6, 0.8], (4, 1)) if directed else np.zeros((4, 2)))
        rows = make_rows(kind, matches, scene)
        hessian = equations_of(scene, pose, rows.part(rows.match == 1, rows.weight)).hessian
        scale = 1 / np.sqrt(np.maximum(np.diag(hessian), 1e-12))
        assert np.linalg.matrix_rank(hessian * scale * scale[:, None], tol=1e-9) == rank


def test_points_behind_a_camera_do_not_count() -> None:
    scene, pose = make_scene(), make_pose(0)
    rows = image_rows(noisy_matches(scene, pose, True, np.arange(20)), scene.cameras)
    behind = replace(rows, divisor=-rows.divisor)
    equations = equations_of(scene, pose, behind)
    assert equations.energy == 0 and not equations.hessian.any() and not equations.gradient.any()
    error, gradient = normal_equations.point_errors(behind, points_of(scene, pose, behind))
    assert not error.any() and not gradient.any()


def test_a_shape_that_changes_with_an_angle_is_the_one_that_is_shown() -> None:
    scene, pose = make_scene(), make_pose(0)
    bulge = np.random.default_rng(0).normal(size=scene.body.vertices.shape) * 0.02
    body = replace(scene.body, morph_offset=bulge, morph_screw=3, morph_range=(-1.0, 1.0))
    scene = replace(scene, body=body)
    rows = image_rows(noisy_matches(make_scene(), pose, True, np.arange(300)), scene.cameras)
    error, _ = normal_equations.point_errors(rows, points_of(scene, pose, rows))
    assert equations_of(scene, pose, rows).energy == pytest.approx(0.5 * rows.weight @ error**2, rel=1e-12)
