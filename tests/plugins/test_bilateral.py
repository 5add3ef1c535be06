"""Noise added to every pixel is measured and smoothed, edges stay, what it does not reach is hidden."""

import cv2
import numpy as np
import pytest
from mocapflow_robustness import disturbances
from mocapflow_robustness.bilateral import Bilateral, mean_clipped, noise_of, roughness, unclipped

SHAPE = (192, 256)


def scene():
    """A room in two colours with a dark limb before it."""
    image = np.full((*SHAPE, 3), (120, 140, 160), np.uint8)
    image[:, 140:] = (90, 70, 60)
    cv2.line(image, (40, 20), (120, 160), (30, 50, 110), 16)
    return image


def noisy(share):
    return disturbances.noisy(scene(), share, "added", np.random.default_rng(0))


@pytest.mark.parametrize(("share", "exact"), [(0.1, 0.03), (0.3, 0.02), (0.6, 0.12)])  # much is cut off
def test_noise_is_measured(share, exact):
    assert noise_of(roughness(noisy(share))) == pytest.approx(255 * share / np.sqrt(3), rel=exact)


def test_planes_and_edges_are_no_noise():
    slope = np.broadcast_to(np.arange(100, 164, dtype=np.uint8)[None, :, None], (48, 64, 3))
    edge = np.where(np.arange(64)[None, :, None] < 30, 40, 200) + np.zeros((48, 64, 3))
    assert not roughness(slope)[8:-8, 8:-8].any()
    assert not roughness(edge.astype(np.uint8)).any()


@pytest.mark.parametrize(("share", "left"), [(0.1, 4.0), (0.3, 7.0), (0.6, 12.0)])
def test_noise_goes_and_limbs_stay(share, left):
    clean = scene()
    image, hidden = Bilateral().restore(noisy(share))
    assert np.sqrt(np.mean((image.astype(float) - clean) ** 2)) < left
    dark = clean[..., 2] == 110
    assert (image[dark][:, 0] < 75).mean() > 0.9  # half-way to the room's colour
    assert not hidden.any()


def test_contrast_that_was_cut_off_is_given_back():
    levels = np.arange(256.0)
    mean = mean_clipped(levels, 80.0)
    assert mean[0] > 25 and mean[255] < 230
    drawn = np.clip(30 + np.random.default_rng(0).uniform(-1, 1, 100_000) * 80 * np.sqrt(3), 0, 255).mean()
    assert mean[30] == pytest.approx(drawn, abs=1.0)
    found = unclipped(np.broadcast_to(mean.astype(np.float32)[None, :, None], (1, 256, 3)), 80.0)
    assert np.abs(found[0, :, 0] - levels).max() <= 1


def test_a_clean_picture_stays_as_it_is_and_nothing_in_it_is_hidden():
    image, hidden = Bilateral().restore(scene())
    np.testing.assert_array_equal(image, scene())
    assert not hidden.any()


def test_what_noise_does_not_reach_is_hidden():
    image = noisy(0.3)
    image[40:88, 60:120] = 77
    image[120:140] = 0
    _, hidden = Bilateral().restore(image)
    assert hidden[40:88, 60:120].mean() > 0.9 and hidden[120:140].mean() > 0.85
    hidden[38:90, 58:122] = hidden[118:142] = False  # the blur reaches a pixel further
    assert not hidden.any()


def test_beside_what_is_hidden_no_more_noise_is_left_than_elsewhere():
    image, clean = noisy(0.6), scene().astype(float)
    image[120:140] = 0
    restored, hidden = Bilateral().restore(image)
    off = np.abs(restored - clean).max(axis=2)
    beside = np.zeros(SHAPE, bool)
    beside[116:144] = True
    assert np.percentile(off[beside & ~hidden], 99) < 1.25 * np.percentile(off[~beside], 99)
    assert not hidden[:116].any() and not hidden[144:].any()
