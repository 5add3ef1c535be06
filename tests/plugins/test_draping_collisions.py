"""Out of the body before strands are draped: pinned particles with their strands, then the particles below them."""

import numpy as np
import pytest
from drape_bodies import EYE, SKIN, lying_cylinder, prepared
from mocapflow_draping.collisions import CLEAR, free_roots, free_strands
from mocapflow_draping.drape_rates import Motion

RADIUS = 0.05
FIRST, LAST = np.array([0, 1], np.int32), np.array([3, 3], np.int32)


def hanging():
    """Two strands: one is pinned 2 mm inside a cylinder that lies along y, the other, a row lower, beside it."""
    grid = np.zeros((2, 4, 3))
    grid[0, :, :2], grid[1, :, :2] = [0.3 * (RADIUS - 0.002), 0], [0.07, 0]
    grid[0, :, 2] = 0.954 * (RADIUS - 0.002) + 0.02 * np.arange(4)
    grid[1, :, 2] = 0.02 * np.arange(4)
    return grid


def freed(grid, rate=None):
    """Return strands whose roots are free, and their rates beside a cylinder that stays."""
    values, parts = prepared(lying_cylinder(RADIUS), EYE)
    grid, motion = grid[None].copy(), None
    if rate is not None:
        still = np.zeros(rate.shape[-1])
        rate = rate.copy()
        motion = Motion(rate, np.zeros_like(rate), np.zeros((len(parts[0]), 3, 4, len(still))), still, still)
    free_roots(grid, FIRST, LAST, parts, values, motion)
    return grid[0], rate


def test_a_strand_whose_pin_is_inside_moves_out_as_it_is():
    before = hanging()
    after, _ = freed(before)
    assert np.linalg.norm(after[0, 0, [0, 2]]) == pytest.approx(RADIUS + CLEAR, abs=5e-4)
    np.testing.assert_allclose(np.diff(after[0], axis=0), np.diff(before[0], axis=0), atol=1e-12)
    np.testing.assert_array_equal(after[1], before[1])


def test_it_moves_on_as_it_is_moved():
    rate = np.repeat(np.random.default_rng(0).normal(size=(2, 1, 3, 4)), 4, axis=1)
    rates = freed(hanging(), rate)[1]
    for column in range(4):
        step = 1e-5 * rate[..., column]
        slope = (freed(hanging() + step)[0] - freed(hanging() - step)[0]) / 2e-5
        np.testing.assert_allclose(rates[..., column], slope, atol=0.15)  # the normal's own turning is left out
    assert np.abs(rates - rate).max() > 0.3


def test_particles_inside_come_out_at_the_length_of_their_bars():
    values, parts = prepared(lying_cylinder(RADIUS), EYE)
    grid = np.zeros((1, 1, 8, 3))
    grid[0, 0, :, 0], grid[0, 0, :, 2] = 0.01, 0.09 - 0.02 * np.arange(8)  # down through the cylinder, off its middle
    links = np.full((1, 1, 7), 0.02)
    free_strands(grid, links, np.zeros(1, np.int32), np.full(1, 7, np.int32), np.array([SKIN]), parts, values)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid[0, 0], axis=0), axis=1), 0.02, atol=1e-12)
    assert np.hypot(grid[0, 0, :, 0], grid[0, 0, :, 2]).min() > RADIUS + SKIN - 5e-4
