"""Lonely pixels are filled, thin things stay, what no noise reaches is hidden, and clean pictures are left alone."""

import cv2
import numpy as np
import pytest
from mocapflow_robustness import disturbances
from mocapflow_robustness.denoise import CHANCE, Denoise, filled, flat, in_company, least_side, noise_share

SHAPE = (96, 128)


def scene():
    """A room in two colours with a dark limb eight pixels wide, seen with a little noise."""
    rng = np.random.default_rng(1)
    image = np.full((*SHAPE, 3), (120, 140, 160), np.uint8)
    image[:, 70:] = (90, 70, 60)
    cv2.line(image, (20, 10), (60, 80), (30, 50, 110), 8)
    return np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)


def off(one, other):
    """Pixels that differ visibly."""
    return np.abs(one.astype(int) - other).max(axis=2) > 20


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6])
def test_noise_goes_and_thin_things_stay(share):
    clean = scene()
    noisy = disturbances.noisy(clean, share, "replaced", np.random.default_rng(0))
    image, hidden = Denoise().restore(noisy)
    assert off(noisy, clean).mean() > 0.9 * share
    assert off(image, clean).mean() < 0.05  # edges, mostly
    limb = off(clean, np.broadcast_to(np.array([120, 140, 160]), clean.shape)) & (np.arange(SHAPE[1]) < 65)
    assert off(image, clean)[limb].mean() < 0.15
    assert share < 0.6 or off(cv2.medianBlur(noisy, 5), clean)[limb].mean() > 0.3
    assert hidden.mean() < 0.01


def test_most_intact_pixels_are_known_and_random_ones_are_not():
    clean = scene()
    noisy = disturbances.noisy(clean, 0.6, "replaced", np.random.default_rng(0))
    kept, replaced = in_company(noisy, 2, 16, 2), off(noisy, clean)
    assert kept[~replaced].mean() > 0.97
    assert kept[replaced].mean() < 0.03
    assert noise_share(kept) == pytest.approx(0.6, abs=0.03)


def test_a_clean_picture_stays_as_it_is_and_nothing_in_it_is_hidden():
    image, hidden = Denoise().restore(scene())
    np.testing.assert_array_equal(image, scene())
    assert not hidden.any()


def test_what_noise_does_not_reach_is_hidden():
    noisy = disturbances.noisy(scene(), 0.6, "replaced", np.random.default_rng(0))
    noisy[20:44, 30:60] = 77
    noisy[60:70] = 0
    _, hidden = Denoise().restore(noisy)
    assert hidden[20:44, 30:60].all() and hidden[60:70].all()
    hidden[19:45, 29:61] = hidden[59:71] = False
    assert not hidden.any()


def test_what_has_one_colour_under_the_noise_is_hidden():
    covered, painted = scene(), np.zeros(SHAPE, bool)
    covered[20:44, 30:60] = 77  # over the limb
    covered[60:74] = 0
    painted[20:44, 30:60] = painted[60:74] = True
    _, hidden = Denoise().restore(disturbances.noisy(covered, 0.6, "replaced", np.random.default_rng(0)))
    assert hidden[painted].mean() > 0.95
    assert not hidden[~cv2.dilate(painted.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)].any()


def test_flat_is_a_square_whose_kept_pixels_are_equal():
    image = np.random.default_rng(0).integers(0, 256, (20, 20, 3), np.uint8)
    image[4:11, 4:11] = 50
    whole = np.ones((20, 20), bool)
    expected = np.zeros((20, 20), bool)
    expected[4:11, 4:11] = True
    assert (flat(image, whole, 7, 5) == expected).all()
    image[7, 7] = 51
    assert not flat(image, whole, 7, 5).any()
    whole[7, 7] = False  # what noise took does not tell
    assert (flat(image, whole, 7, 5) == expected).all()
    assert not flat(image, whole, 7, 9).any()  # chance would leave as much
    assert not flat(image, np.zeros((20, 20), bool), 7, 5).any()  # nor does a place of which nothing is left
    assert not flat(image, ~whole, 7, least_side(1.0)).any()


@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_is_flat_near_a_square(turned):
    image = np.random.default_rng(0).integers(0, 256, (60, 60, 3), np.uint8)
    expected = np.zeros((60, 60), bool)
    expected[4:11, 4:11] = expected[14:17, 6:18] = True
    image[expected] = 50
    image[14:17, 6:18] = 90
    image[50:53, 40:60] = 50  # far from any
    image[22:25, 4:10] = 50  # shorter than the square
    image[4:13, 18:20] = 50  # narrower than the strip
    if turned:
        image, expected = image.transpose(1, 0, 2).copy(), expected.T
    assert (flat(image, np.ones((60, 60), bool), 7, 5) == expected).all()


@pytest.mark.parametrize("share", [0.02, 0.4, 0.6, 0.98])
def test_chance_does_not_fill_the_least_side(share):
    side = least_side(share)
    assert side % 2 == 1
    assert share ** (side**2) <= CHANCE < share ** (max(side - 3, 0) ** 2)


def test_a_pixel_is_filled_from_those_that_are_known():
    image = np.zeros((9, 9, 3), np.uint8)
    image[:, :4], image[4, 4] = 100, 255
    known = np.ones((9, 9), bool)
    known[4, 4] = False
    mean = filled(image, known, ~known, 1.0)
    assert 30 < mean[4, 4, 0] < 50
    assert (mean[known] == image[known]).all()
    assert (filled(image, ~known & False, ~known, 1.0) == image).all()  # nothing is known
