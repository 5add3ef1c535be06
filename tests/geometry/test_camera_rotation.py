"""How a nudged camera has turned."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocapflow.assets import Camera
from mocapflow.geometry import camera_rotation
from mocapflow.geometry.camera_rotation import shift_px, turn_between, warped, warped_points
from mocapflow.geometry.cameras import project

CAMERA = Camera(
    name="cam01",
    intrinsics=np.array([[430.0, 0, 160], [0, 430, 200], [0, 0, 1]]),
    distortion=np.zeros(5),
    size=np.array([320, 400], np.int32),
    camera_from_world=np.eye(4),
)
EVERYWHERE = np.ones((400, 320), bool)


def room(noise=1.0, seed=0, height=400, width=320):
    """A room with many things in it, the same for every seed of the noise."""
    coarse = np.random.default_rng(7).uniform(40, 200, (height // 20, width // 20, 3))
    smooth = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return levels(smooth + np.random.default_rng(seed).normal(0, noise, smooth.shape))


def levels(picture):
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def homography(degrees, camera=CAMERA):
    """Of a camera turned about its axes."""
    turn = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    return camera.intrinsics @ turn @ np.linalg.inv(camera.intrinsics)


def seen(turn, noise=1.0):
    return levels(warped(room(0.0), turn)[0] + np.random.default_rng(1).normal(0, noise, (400, 320, 3)))


def corners_off(found, true):
    ends = np.array([[0, 0, 1], [320, 0, 1], [0, 400, 1], [320, 400, 1.0]])
    here, there = ends @ found.T, ends @ true.T
    return np.linalg.norm(here[:, :2] / here[:, 2:] - there[:, :2] / there[:, 2:], axis=1).max()


@pytest.mark.parametrize("degrees", [(0.15, 0, 0), (0.2, -0.3, 0.4), (-1.5, 2.0, 1.0), (0, 4.0, 0)])
def test_the_turn_of_a_camera_is_found(degrees):
    true = homography(degrees)
    assert corners_off(turn_between(room(), seen(true), EVERYWHERE, CAMERA), true) < 0.15


def test_pixels_of_a_camera_that_turns_and_zooms_are_those_of_the_camera_it_becomes():
    turn = Rotation.from_euler("xyz", (3, -5, 8), degrees=True).as_matrix()
    points = np.array([[0.1, 0.2, 1], [-0.2, 0, 2]])
    moved = np.eye(4)
    moved[:3, :3] = turn
    after = replace(CAMERA, camera_from_world=moved, intrinsics=CAMERA.intrinsics @ np.diag([1.2, 1.2, 1.0]))
    found = warped_points(project(points, CAMERA)[None], camera_rotation.homography(turn, CAMERA, 1.2))
    np.testing.assert_allclose(found[0], project(points, after), atol=1e-9)


@pytest.mark.parametrize("zoom", [0.99, 1.004])
def test_a_lens_that_is_focused_anew_is_told_from_a_turn(zoom):
    true = CAMERA.intrinsics @ np.diag([zoom, zoom, 1.0]) @ np.linalg.inv(CAMERA.intrinsics) @ homography((0, 0.3, 0))
    assert corners_off(turn_between(room(), seen(true), EVERYWHERE, CAMERA), true) < 0.15


def test_whoever_stands_before_the_room_does_not_count():
    true = homography((0.2, -0.3, 0.4))
    picture = seen(true)
    person = np.random.default_rng(3).uniform(0, 255, (30, 13, 3))
    picture[60:360, 90:220] = cv2.resize(person, (130, 300), interpolation=cv2.INTER_CUBIC)
    assert corners_off(turn_between(room(), picture, EVERYWHERE, CAMERA), true) < 0.2


def test_what_moves_together_in_a_corner_is_not_the_room():
    true, picture = homography((0.2, -0.3, 0.4)), seen(homography((0.2, -0.3, 0.4)))
    picture[300:, :110] = np.roll(room(), 9, axis=1)[300:, :110]  # a carpet that somebody pushed
    assert corners_off(turn_between(room(), picture, EVERYWHERE, CAMERA), true) < 0.2


def test_hidden_pixels_do_not_count():
    true, picture = homography((0.2, -0.3, 0.4)), seen(homography((0.2, -0.3, 0.4)))
    picture[:, :250] = np.roll(room(), 9, axis=1)[:, :250]
    shown = EVERYWHERE.copy()
    shown[:, :250] = False
    assert corners_off(turn_between(room(), picture, shown, CAMERA), true) < 0.4


@pytest.mark.parametrize("picture", [room(seed=2), room(8.0, seed=2)], ids=["at rest", "noise"])
def test_a_camera_at_rest_has_not_turned(picture):
    np.testing.assert_array_equal(turn_between(room(seed=1), picture, EVERYWHERE, CAMERA), np.eye(3))


@pytest.mark.parametrize(
    "picture",
    [np.flip(room(), axis=1).copy(), np.zeros((400, 320, 3), np.uint8), np.full((400, 320, 3), 120, np.uint8)],
    ids=["another room", "black", "grey"],
)
def test_where_too_little_tells_there_is_no_answer(picture):
    assert turn_between(room(), picture, EVERYWHERE, CAMERA) is None
    assert turn_between(picture, room(), EVERYWHERE, CAMERA) is None


def test_a_plate_is_not_known_beyond_its_border():
    turn = homography((0, 1.0, 0))  # by 430 tan 1° = 7.5 px
    moved, known = warped(room(0.0), turn)
    assert shift_px(turn, CAMERA) == pytest.approx(430 * np.tan(np.radians(1)), rel=0.2)
    assert known.mean() == pytest.approx(1 - 7.5 / 320, abs=0.01)
    back, _ = warped(moved, np.linalg.inv(turn))
    np.testing.assert_allclose(back[20:-20, 20:-20].astype(float), room(0.0)[20:-20, 20:-20], atol=2.0)
