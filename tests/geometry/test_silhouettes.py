"""Silhouettes against shapes whose outline is known."""

from __future__ import annotations

import numpy as np
import pytest

from mocapflow.assets import Camera
from mocapflow.data import BODY, CLOTH, Surface
from mocapflow.geometry import meshes, sewing, silhouettes, span_kernels
from mocapflow.geometry import silhouette_kernels as kernels
from mocapflow.records import F64, I32, Bool
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_scene

FOCAL, DISTANCE, RADIUS = 500.0, 3.0, 0.5


def camera() -> Camera:
    """Look along +y from the origin; image right is world x, image down is world -z."""
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    intrinsics = np.array([[FOCAL, 0, 159.5], [0, FOCAL, 119.5], [0, 0, 1.0]])
    return Camera(
        name="cam",
        size=np.array([320, 240], np.int32),
        intrinsics=intrinsics,
        distortion=np.zeros(5),
        camera_from_world=pose,
    )


def surface(vertices: F64, faces: I32, layer: int = BODY) -> Surface:
    return Surface(
        vertices=vertices,
        faces=faces,
        edges=meshes.edges(faces),
        layer=np.full(len(vertices), layer, np.uint8),
        joints=np.zeros((1, 4, 4)),
        screws=np.zeros((0, 6)),
    )


def sheet_faces(rows: int, columns: int, closed: bool = False) -> I32:
    """The faces of a grid of vertices, row by row; closed, the last column is beside the first."""
    return sewing.grid_faces(np.arange(rows * columns, dtype=np.int32).reshape(rows, columns).T, closed)


def sphere(centre: tuple[float, float, float], rows: int = 60, columns: int = 120) -> tuple[F64, I32]:
    """A closed sphere: rings from pole to pole, the poles as small caps of one vertex."""
    polar = np.linspace(0, np.pi, rows + 2)[1:-1, None]
    azimuth = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    ring = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth]
    points = np.stack(ring, -1).reshape(-1, 3)
    vertices = np.concatenate([points, [[0, 0, 1.0]], [[0, 0, -1.0]]]) * RADIUS + centre
    body = sheet_faces(rows, columns, closed=True)
    around, last = np.arange(columns, dtype=np.int32), (rows - 1) * columns
    after, north, south = (around + 1) % columns, np.full(columns, len(points)), np.full(columns, len(points) + 1)
    caps = [np.column_stack([north, around, after]), np.column_stack([south, last + after, last + around])]
    return vertices, np.concatenate([body, *caps]).astype(np.int32)


def circle_radius() -> float:
    return FOCAL * RADIUS / np.sqrt(DISTANCE**2 - RADIUS**2)


def circle_distance(offset: float = 0.0) -> F64:
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    return circle_radius() - np.hypot(x - 159.5 - offset, y - 119.5)


def test_every_edge_of_a_closed_mesh_has_two_faces() -> None:
    _, faces = sphere((0, DISTANCE, 0))
    edges = meshes.edges(faces)
    assert len(edges) == 3 * len(faces) / 2
    assert (edges[:, 2:] >= 0).all()
    assert meshes.edges(faces[:0]).shape == (0, 4)


def test_normals_of_a_sphere_point_outward() -> None:
    vertices, faces = sphere((0, DISTANCE, 0))
    radial = (vertices - [0, DISTANCE, 0]) / RADIUS
    assert np.abs(meshes.vertex_normals(vertices, faces) - radial).max() < 0.02


def test_a_sphere_covers_its_disc_once() -> None:
    mask = silhouettes.covered(surface(*sphere((0, DISTANCE, 0))), camera())
    expected = circle_distance() > 0
    assert (mask ^ expected).sum() < 0.002 * expected.sum()


def test_the_distance_to_the_outline_is_subpixel() -> None:
    distance = silhouettes.model_distance(surface(*sphere((0, DISTANCE, 0))), camera(), 12.0)
    truth = np.clip(circle_distance(), -12, 12)
    assert np.abs(distance - truth).max() < 0.12  # a polygon of 120 corners leaves the circle by up to 0.03 px


def test_contour_points_lie_on_the_circle_evenly_with_outward_normals() -> None:
    contour = silhouettes.occluding_contour(surface(*sphere((0, DISTANCE, 0))), camera(), 4.0)
    radial = contour.pixel - [159.5, 119.5]
    radius = np.linalg.norm(radial, axis=1)
    assert len(radius) == pytest.approx(2 * np.pi * circle_radius() / 4.0, abs=2)
    assert np.abs(radius - circle_radius()).max() < 0.1
    assert np.sum(radial * contour.normal, axis=1).min() > 0.97 * radius.min()


def test_a_sphere_before_another_hides_the_edge_between() -> None:
    near, far = sphere((0.1, DISTANCE, 0)), sphere((-0.1, DISTANCE + 1.5, 0))
    vertices = np.concatenate([near[0], far[0]])
    both = surface(vertices, np.concatenate([near[1], far[1] + np.int32(len(near[0]))]))
    contour = silhouettes.occluding_contour(both, camera(), 4.0)
    distance = silhouettes.model_distance(both, camera(), 12.0)
    columns, rows = np.round(contour.pixel).astype(int).T
    assert np.abs(distance[rows, columns]).max() < 1.2


def test_an_open_sheet_of_cloth_is_seen_from_both_sides() -> None:
    grid = np.array([[x, DISTANCE, z] for z in np.linspace(0.3, -0.3, 7) for x in np.linspace(-0.3, 0.3, 7)])
    faces = sheet_faces(7, 7)
    for turned in (faces, faces[:, ::-1].copy()):
        sheet, view = surface(grid, turned, CLOTH), camera()
        boundary = silhouettes.outline(sheet, view)
        assert silhouettes.covered(sheet, view).sum() == pytest.approx((0.6 * FOCAL / DISTANCE) ** 2, rel=0.03)
        assert len(np.unique(boundary.vertex[boundary.edge], axis=0)) == 24


def test_a_folded_sheet_ends_at_its_fold() -> None:
    z = np.linspace(0.2, -0.2, 5)
    x, y = np.array([-0.2, 0.0, 0.2, 0.0, -0.2]), DISTANCE + np.array([0, 0.02, 0.05, 0.08, 0.1])
    grid = np.array([[x[k], y[k], z[row]] for row in range(5) for k in range(5)])
    boundary = silhouettes.outline(surface(grid, sheet_faces(5, 5), CLOTH), camera())
    assert boundary.pixel[..., 0].max() == pytest.approx(159.5 + FOCAL * 0.2 / (DISTANCE + 0.05), abs=1e-6)


def test_a_surface_behind_the_camera_has_no_outline() -> None:
    behind, view = surface(*sphere((0, -DISTANCE, 0))), camera()
    assert len(silhouettes.outline(behind, view).pixel) == 0
    assert not silhouettes.covered(behind, view).any()


def test_the_visible_part_of_a_long_half_hidden_edge_stays() -> None:
    wide = np.array([[x, DISTANCE, z] for z in (0.2, -0.2) for x in (-0.4, 0.4)])
    tall = np.array([[x, DISTANCE - 0.5, z] for z in (0.4, -0.3) for x in (0.0, 0.5)])
    sheet = sheet_faces(2, 2)
    both = surface(np.concatenate([wide, tall]), np.concatenate([sheet, sheet + np.int32(4)]), CLOTH)
    distance = silhouettes.model_distance(both, camera(), 12.0)
    row = 119.5 - 0.2 * FOCAL / DISTANCE
    column = int(159.5 - 0.3 * FOCAL / DISTANCE)
    above = int(row) - 4
    assert distance[above, column] == pytest.approx(above - row, abs=1e-4)
    contour = silhouettes.occluding_contour(both, camera(), 4.0)
    top = contour.pixel[np.abs(contour.pixel[:, 1] - row) < 1e-6]
    assert top[:, 0].min() < 159.5 - 0.39 * FOCAL / DISTANCE
    assert 155 < top[:, 0].max() < 161


def test_an_edge_that_runs_away_takes_no_memory():
    ends = np.array([[[0.0, 0.0], [1e12, 5.0]], [[0.0, 0.0], [8.0, 0.0]]])
    nothing = np.zeros(241, np.int32), np.empty((0, 2), np.int32)
    edge, pieces = kernels.boundary(ends, np.ones(2, np.int32), *nothing, 4.0)
    assert np.bincount(edge).tolist() == [kernels.MOST_PIECES, 2]
    np.testing.assert_allclose(pieces[kernels.MOST_PIECES - 1, 1], ends[0, 1])


def test_what_overlapping_triangles_cover_and_where_it_ends() -> None:
    """Against signs of sides at every pixel, and looking up what lies beyond; some lie outside the image."""
    rng = np.random.default_rng(3)
    corners = rng.uniform(-60, 380, (12, 3, 2))
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0
    corners[turned] = corners[turned, ::-1]  # all one way round
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    inside = np.any([winding(triangle, x, y) for triangle in corners], axis=0)

    size = np.array([320, 240], np.int32)
    layers = np.ones(len(ends), np.int32)
    first, spans = span_kernels.covered(*span_kernels.crossings(ends, size), layers, 320)
    edge, pieces = kernels.boundary(ends, layers, first, spans, 1e9)  # in one piece each
    drawn = np.zeros((240, 320), bool)
    for row in range(240):
        for begin, end in spans[first[row] : first[row + 1]]:
            assert not drawn[row, begin:end].any()
            drawn[row, begin:end] = True
    np.testing.assert_array_equal(drawn, inside)

    way = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    beyond = ends.mean(axis=1) + kernels.REACH * way[:, ::-1] * [-1, 1] / length
    column, row = np.floor(beyond + 0.5).astype(int).T
    shown = (column >= 0) & (column < 320) & (row >= 0) & (row < 240)
    free = ~shown | ~inside[np.clip(row, 0, 239), np.clip(column, 0, 319)]
    assert 5 < free.sum() < 30
    np.testing.assert_array_equal(edge, np.flatnonzero(free))
    np.testing.assert_allclose(pieces, ends[edge])


def winding(triangle: F64, x: I32, y: I32) -> Bool:
    """Return which pixels lie within a triangle that winds about them, by the signs of its sides."""
    ends = zip(triangle, np.roll(triangle, -1, axis=0), strict=True)
    return np.all([(b - a)[0] * (y - a[1]) < (b - a)[1] * (x - a[0]) for a, b in ends], axis=0)


def test_the_skin_has_the_outline_of_the_bare_body() -> None:
    scene = tiny_scene(clothed=True)
    pose = tiny_pose(scene)
    dressed = scene.surface(pose, tiny_cloth(scene, pose))
    bare = scene.bare(dressed)
    for view in scene.cameras:
        one, other = silhouettes.skin_outline(dressed, view), silhouettes.outline(bare, view)
        np.testing.assert_array_equal(np.unique(one.pixel, axis=0), np.unique(other.pixel, axis=0))


def test_a_surface_is_looked_at_once() -> None:
    seen = surface(*sphere((0, DISTANCE, 0)))
    view = camera()
    assert silhouettes.outline(seen, view) is silhouettes.outline(seen, view)
    assert silhouettes.outline(seen, view) is not silhouettes.outline(seen, camera())
    assert silhouettes.model_distance(seen, view, 8.0).max() < silhouettes.model_distance(seen, view, 12.0).max()


def test_the_distance_of_a_mask_is_that_of_its_pixels_to_the_edge_between_them():
    inside = np.zeros((20, 30), bool)
    inside[:, 12:] = True
    away = np.arange(30, dtype=np.float32) - 11.5  # the edge of the half plane
    np.testing.assert_array_equal(silhouettes.mask_distance(inside), np.tile(away, (20, 1)))
    np.testing.assert_array_equal(silhouettes.mask_distance(~inside), -np.tile(away, (20, 1)))
