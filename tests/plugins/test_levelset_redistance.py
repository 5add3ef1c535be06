"""Sub-pixel redistancing (T-LS5)."""

import numpy as np
import pytest
from mocapflow_levelset.redistance import redistance


def circle(radius=60.3, size=180, x=90.3, y=89.6):
    rows, columns = np.mgrid[:size, :size]
    return (radius - np.hypot(columns - x, rows - y)).astype(np.float32)


def crossings(level):
    """Return where the zero contour crosses the rows' pixel edges, by linear interpolation."""
    left, right = level[:, :-1], level[:, 1:]
    crossed = (left > 0) != (right > 0)
    return np.where(crossed, left / np.where(crossed, left - right, 1), np.nan)


def test_a_circle_gets_its_distance():
    exact = circle()
    found = redistance(np.clip(exact * 1.7, -5, 5), 12.0)
    assert np.abs(found - np.clip(exact, -12, 12)).max() <= 0.02


def test_the_contour_stays():
    level = circle() * np.float32(0.6)
    moved = np.abs(crossings(redistance(level, 8.0)) - crossings(level))
    assert np.nanmax(moved) <= 0.01


def test_it_does_not_pin_a_moving_front():
    """25 moves of 0.2 px, redistanced after each, are 5 px; a distance transform of the mask would stay."""
    level = redistance(circle(40.0), 10.0)
    for _ in range(25):
        level = redistance(level + np.float32(0.2), 10.0)
    area = (np.clip(level, -0.5, 0.5) + 0.5).sum()
    assert abs(np.sqrt(area / np.pi) - 45.0) <= 0.2


@pytest.mark.parametrize("band", [5.0, 12.0])
def test_it_is_clipped_and_keeps_signs(band):
    level = circle(20.0, 64, 31, 33)
    found = redistance(level, band)
    assert np.abs(found).max() <= band
    assert ((found > 0) == (level > 0)).all()


def test_two_touching_squares():
    """A saddle is resolved by the sign of its middle; distances stay right next to it."""
    level = -np.ones((12, 12), np.float32)
    level[2:6, 2:6], level[6:10, 6:10] = 1, 1
    found = redistance(level, 5.0)
    np.testing.assert_allclose(found[3, 3], 1.5, atol=0.02)
    np.testing.assert_allclose(found[3, 0], -1.5, atol=0.02)


def test_without_a_contour_all_is_far():
    np.testing.assert_array_equal(redistance(-np.ones((9, 9), np.float32), 6.0), -6)
    np.testing.assert_array_equal(redistance(np.ones((9, 9), np.float32), 6.0), 6)
