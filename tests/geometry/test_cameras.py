"""T-CAM: projection and its inverse to 1e-9 px, lens distortion there and back to 0.01 px."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocapflow.geometry import cameras, lines
from tests.fixtures.recordings import look_at

LENSES = {
    "mild": ((-0.0462, 0.14, 0.0006, 0.0007), False),
    "strong": ((-0.28, 0.09, 0.001, -0.0008, -0.012), False),
    "fisheye": ((-0.02, 0.01, -0.005, 0.001), True),
    "equidistant": ((), True),
}


def camera(distortion=(), fisheye=False):
    made = look_at("a", np.array([3.0, -2.0, 1.7]), size=(1088, 1920), focal=1680.0, distortion=distortion)
    return replace(made, fisheye=fisheye)


def pixels(seed=0, count=500):
    return np.random.default_rng(seed).uniform([0, 0], [1087, 1919], size=(count, 2))


def test_projecting_a_point_of_a_ray_gives_its_pixel():
    wanted, view = pixels(), camera()
    rays = lines.through(wanted, view)
    depth = np.random.default_rng(1).uniform(0.5, 20, size=(len(wanted), 1))
    points = cameras.centre(view) + depth * rays[:, :3]
    assert np.abs(cameras.project(points, view) - wanted).max() < 1e-9


def test_magnification_is_how_far_a_step_aside_moves_the_pixel():
    view, point = camera(), np.array([0.2, 0.1, 0.9])
    aside = 1e-6 * view.camera_from_world[0, :3]  # the camera's x axis
    moved = np.linalg.norm(np.diff(cameras.project(np.stack([point, point + aside]), view), axis=0))
    assert abs(moved / 1e-6 / cameras.magnification(view, point) - 1) < 1e-6


def test_points_behind_the_camera_have_no_pixel():
    view = camera()
    behind = cameras.centre(view) - view.camera_from_world[2, :3]
    assert np.isnan(cameras.project(behind[None], view)).all()
    beside = np.array([[1.0, 2.0, 0.0]])  # in the plane of the camera: neither behind it nor ahead
    assert np.isnan(cameras.project(beside, replace(view, camera_from_world=np.eye(4)))).all()


def test_rays_of_several_rows_of_pixels_are_those_of_each():
    view, wanted = camera(), pixels(count=6)
    rays = cameras.directions(wanted.reshape(2, 3, 2), view)
    np.testing.assert_allclose(cameras.project(cameras.centre(view) + rays.reshape(6, 3), view), wanted, atol=1e-9)
    np.testing.assert_allclose(rays @ view.camera_from_world[2, :3], 1.0)  # one metre deep


@pytest.mark.parametrize("lens", LENSES)
def test_distortion_there_and_back(lens):
    view, seen = camera(*LENSES[lens]), pixels()
    assert np.abs(cameras.distort(cameras.undistort(seen, view), view) - seen).max() < 0.01


@pytest.mark.parametrize(
    ("distortion", "fisheye", "last"),
    [
        ((-0.5,), False, 0.545),  # r (1 - r^2 / 2) is greatest there, times the focal length
        ((-0.1, -0.05), True, 0.904),  # theta (1 - theta^2 / 10 - theta^4 / 20) too
        ((), True, np.pi / 2),  # 90 degrees
    ],
)
def test_a_pixel_that_no_ray_meets_is_nowhere(distortion, fisheye, last):
    view = look_at("a", np.array([3.0, -2.0, 1.7]), size=(1920, 1080), focal=500.0, distortion=distortion)
    view = replace(view, fisheye=fisheye)
    radius = 500.0 * np.linspace(0, 4, 80)
    ideal = cameras.undistort(view.intrinsics[:2, 2] + np.outer(radius, [0.6, 0.8]), view)
    assert np.isnan(ideal[radius > 500 * last]).all()
    assert (np.diff(np.linalg.norm(ideal[radius < 0.95 * 500 * last] - view.intrinsics[:2, 2], axis=1)) > 0).all()


@pytest.mark.parametrize("lens", ["mild", "strong"])
def test_undistorted_projection_equals_opencv(lens):
    view = camera(*LENSES[lens])
    points = np.random.default_rng(2).normal(size=(300, 3)) * 0.4 + [0, 0, 1]
    rotation, _ = cv2.Rodrigues(view.camera_from_world[:3, :3])
    seen, _ = cv2.projectPoints(points, rotation, view.camera_from_world[:3, 3], view.intrinsics, view.distortion)
    assert np.abs(cameras.undistort(seen[:, 0], view) - cameras.project(points, view)).max() < 0.01


def test_a_fisheye_without_coefficients_shows_angles_as_radii():
    view = camera(fisheye=True)
    middle, focal = view.intrinsics[:2, 2], view.intrinsics[0, 0]
    angle = np.radians([10.0, 25.0, 40.0])
    seen = middle + focal * np.outer(angle, [0.6, 0.8])
    expected = middle + focal * np.outer(np.tan(angle), [0.6, 0.8])
    np.testing.assert_allclose(cameras.undistort(seen, view), expected, atol=1e-6)
    np.testing.assert_allclose(cameras.distort(expected, view), seen, atol=1e-6)


def test_a_camera_without_distortion_returns_the_pixels():
    np.testing.assert_array_equal(cameras.undistort(pixels(), camera()), pixels())
    assert cameras.undistort(np.empty((0, 2)), camera(*LENSES["mild"])).shape == (0, 2)


@pytest.mark.parametrize("factor", [0.5, 0.25, 0.3])
def test_scaled_camera_keeps_pixel_centres_on_integers(factor):
    view = camera()
    small = cameras.scaled(view, factor)
    corners = np.array([[-0.5, -0.5], [1087.5, 1919.5], [1087.5, -0.5]])  # outer corners stay outer corners
    points = cameras.centre(view) + 3 * lines.through(corners, view)[:, :3]
    wanted = np.array([[0, 0], small.size, [small.size[0], 0]]) - 0.5
    assert np.abs(cameras.project(points, small) - wanted).max() < 1e-9


def test_pixels_of_a_shrunk_camera_are_squares_of_whole_ones_whatever_is_left_over():
    view = replace(camera(), size=np.array([1090, 1923], np.int32))
    small = cameras.shrunk(view, 4)
    assert small.size.tolist() == [272, 480]
    points = cameras.centre(view) + 3 * lines.through(pixels(), view)[:, :3]
    np.testing.assert_allclose(cameras.project(points, small), (pixels() + 0.5) / 4 - 0.5, atol=1e-9)


def test_pinhole_only_drops_the_distortion():
    view = camera(*LENSES["fisheye"])
    plain = cameras.pinhole(view)
    assert not plain.distortion.any()
    assert not plain.fisheye
    np.testing.assert_array_equal(plain.intrinsics, view.intrinsics)


def test_each_point_in_its_own_view():
    views = [look_at(str(k), np.array([3.0, k - 1.0, 1.7])) for k in range(3)]
    points = np.random.default_rng(0).uniform(0, 1, (5, 3))
    view = np.array([2, 0, 1, 0, 2], np.int16)
    expected = [cameras.project(point[None], views[k])[0] for point, k in zip(points, view, strict=True)]
    np.testing.assert_allclose(cameras.project_each(points, view, views), expected)
