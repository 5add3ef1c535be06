"""Images and keypoints of a lens end where the pinhole camera says."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.geometry.cameras import distort, project
from mocapflow.io.cameras.views import View
from tests.fixtures.recordings import look_at

LENSES = {
    "none": ((), False),
    "radial": ((-0.25, 0.08, 0.001, -0.001), False),
    "fisheye": ((-0.02, 0.01, 0, 0), True),
    "equidistant": ((), True),
}


def lens(name, size=(200, 160)):
    distortion, fisheye = LENSES[name]
    made = look_at("a", np.array([3.0, -2.0, 1.4]), size=size, focal=180.0, distortion=distortion)
    return replace(made, fisheye=fisheye)


def seen(points, camera):
    """Return what the lens shows of points in space: pixels (M, 2)."""
    return distort(project(points, camera), camera)


def dot(pixel, size):
    """Return a black image with one bright blob at a pixel."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    grey = 250 * np.exp(-((x - pixel[0]) ** 2 + (y - pixel[1]) ** 2) / (2 * 3.0**2))
    return np.repeat(np.round(grey).astype(np.uint8)[..., None], 3, axis=2)


def centre_of(image):
    y, x = np.indices(image.shape[:2])
    return np.array([np.average(x, weights=image[..., 0]), np.average(y, weights=image[..., 0])])


POINTS = np.array([[0, 0, 1.0], [0.7, 0.5, 1.6], [-0.6, 0.4, 0.4], [0.5, -0.8, 0.5]])


@pytest.mark.parametrize("scale", [1.0, 0.5, 0.33])  # 160 by the last are 53 px, not quite
@pytest.mark.parametrize("name", LENSES)
def test_image_and_keypoints_agree_with_the_pinhole_camera(name, scale):
    view = View(lens=lens(name), scale=scale)
    pixels = seen(POINTS, view.lens)
    wanted = project(POINTS, view.camera)
    for pixel, target in zip(pixels, wanted, strict=True):
        image = view.image(dot(pixel, view.lens.size))
        assert image.shape == (round(160 * scale), round(200 * scale), 3)
        assert np.linalg.norm(centre_of(image) - target) < 0.1  # the blob itself is bent a little
    people = np.column_stack([pixels, np.full(4, 0.7)])[None]
    moved = view.points(people)
    assert np.abs(moved[0, :, :2] - wanted).max() < 0.01
    np.testing.assert_array_equal(moved[..., 2], people[..., 2])


def test_unseen_points_stay_unseen():
    moved = View(lens=lens("radial"), scale=0.5).points(np.array([[[30.0, 40, 0.5], [0, 0, 0], [50, 60, 0]]]))
    assert (moved[0, 1:] == 0).all()
    assert moved[0, 0, 2] == 0.5


def test_a_keypoint_where_the_lens_shows_nothing_is_not_seen():
    strong = replace(lens("none", size=(800, 600)), distortion=np.array([-0.5, 0, 0, 0, 0]))
    moved = View(lens=strong).points(np.array([[[400.0, 310, 0.9], [790, 590, 0.9]]]))
    assert moved[0, 0, 2] == 0.9
    assert (moved[0, 1] == 0).all()


def test_without_distortion_the_image_is_passed_on():
    view, image = View(lens=lens("none")), np.full((160, 200, 3), 7, np.uint8)
    assert view.image(image) is image
    assert view.image(None).shape == (160, 200, 3)
    assert not view.image(None).any()
