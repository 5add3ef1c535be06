"""An edge lies where pixels are half person and half room, whatever shadow falls beside it."""

import numpy as np
import pytest
from mocapflow_levelset.matting import MOST_PX, NEAR_PX, sharpened
from scipy.special import ndtr

SIZE = 80
SHIRT, WALL = np.array([90.0, 120.0, 190.0]), np.array([150.0, 140.0, 120.0])  # BGR
BLUR_PX = 0.6  # of the lens


def pictured(angle_deg, shade=1.0, noise=1.0):
    """Return a blurred edge (H, W, 3) between shirt and a textured wall in shade, the wall, and the distance."""
    rng = np.random.default_rng(7)
    row, column = np.mgrid[:SIZE, :SIZE]
    angle = np.radians(angle_deg)
    distance = np.cos(angle) * (39.3 - column) + np.sin(angle) * (39.3 - row)  # positive inside
    wall = WALL * (1 + 0.1 * np.sin(column / 5.0) * np.cos(row / 7.0))[..., None]
    share = ndtr(distance / BLUR_PX)[..., None]
    image = share * SHIRT + (1 - share) * wall * shade + rng.normal(0, noise, wall.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), wall.astype(np.float32), distance.astype(np.float32)


def left_over(angle_deg, off_px, shade=1.0, counted=True):
    """Return by how much a contour that is off by `off_px` outward still is, in px, near the middle."""
    image, wall, distance = pictured(angle_deg, shade)
    level = sharpened(distance + np.float32(off_px), image, wall, np.full(distance.shape, counted), 2)
    middle = (np.abs(distance + off_px) < 1) & (np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 25)
    return (level - distance)[middle]


@pytest.mark.parametrize("angle_deg", [0, 30, 90, 200, 315])
@pytest.mark.parametrize("off_px", [-0.6, 0.0, 0.6])
def test_it_finds_the_edge_within_its_pixels(angle_deg, off_px):
    assert np.abs(left_over(angle_deg, off_px)).max() < 0.15
    assert np.abs(left_over(angle_deg, off_px).mean()) < 0.06


@pytest.mark.parametrize("shade", [0.6, 0.8])
def test_a_shadow_beside_the_person_moves_nothing(shade):
    assert np.abs(left_over(20, 0.5, shade).mean()) < 0.06


def test_where_nothing_counts_the_contour_stays():
    assert left_over(20, 0.5, counted=False) == pytest.approx(0.5)


def test_an_edge_that_cannot_be_seen_moves_nothing():
    """A shirt of the wall's colour: the faint noise is all there is to see."""
    _, wall, distance = pictured(20)
    same = np.clip(np.rint(wall + np.random.default_rng(1).normal(0, 1, wall.shape)), 0, 255).astype(np.uint8)
    level = sharpened(distance, same, wall, np.ones(distance.shape, bool), 2)
    assert np.abs(level - distance).max() < 0.15


@pytest.mark.parametrize("angle_deg", [0, 30, 315])
def test_a_distance_near_the_contour_is_enough(angle_deg):
    image, wall, distance = pictured(angle_deg, noise=20.0)
    near, whole = (
        sharpened(np.clip(distance, -band, band), image, wall, np.full(distance.shape, True), 2)
        for band in (np.float32(NEAR_PX), np.float32(20))
    )
    np.testing.assert_array_equal(near > 0, whole > 0)
    beside = np.abs(whole) < NEAR_PX - MOST_PX - 0.1
    assert beside.sum() > 4 * SIZE
    np.testing.assert_array_equal(near[beside], whole[beside])
