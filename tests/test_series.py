"""Rows that are made when they are asked for: indexed as an array is, and only those asked for are made."""

import numpy as np
import pytest

from mocapflow.series import BLOCK, Series, blocks, changed, joined, overwritten, picked

VALUES = np.random.default_rng(0).normal(size=(150, 2, 3))


@pytest.fixture
def asked():
    """Row numbers that were asked for."""
    return []


@pytest.fixture
def series(asked):
    def rows(numbers):
        asked.extend(numbers.tolist())
        return VALUES[numbers]

    return Series(VALUES.shape, rows)


@pytest.mark.parametrize(
    "which",
    [
        7, -1, slice(3, 9), slice(None, None, -40), np.array([5, 2, 5]), np.arange(150) % 50 == 1, (slice(4), 1),
        ..., (..., 1), (3, ..., 1),
    ],
)  # fmt: skip
def test_it_is_indexed_as_an_array_is(series, which):
    np.testing.assert_array_equal(series[which], VALUES[which])


def test_only_what_is_asked_for_is_made(series, asked):
    assert series[3:5].shape == (2, 2, 3)
    doubled = changed(series, lambda values, numbers: 2 * values + numbers[:, None, None])
    late = picked(doubled, np.arange(150) >= 100)
    assert asked == [3, 4]
    np.testing.assert_array_equal(late[1], 2 * VALUES[101] + 101)
    assert asked == [3, 4, 101]


def test_two_end_to_end(series):
    both = joined(picked(series, np.arange(3)), VALUES[3:8])
    assert both.shape == (8, 2, 3)
    np.testing.assert_array_equal(both[np.array([7, 0, 3, 2])], VALUES[[7, 0, 3, 2]])
    np.testing.assert_array_equal(np.asarray(both), VALUES[:8])


@pytest.mark.parametrize("whole", [True, False])
def test_some_rows_are_overwritten(series, asked, whole):
    new = overwritten(VALUES if whole else series, {3: np.ones((2, 3)), 140: np.zeros((2, 3))})
    assert not asked
    assert (new[3] == 1).all() and not new[140].any() and new[np.empty(0, int)].shape == (0, 2, 3)
    np.testing.assert_array_equal(new[4:140], VALUES[4:140])


def test_it_is_gone_through_block_by_block(series, asked):
    rows = iter(series)
    np.testing.assert_array_equal(next(rows), VALUES[0])
    assert len(asked) == BLOCK
    assert sum(1 for _ in rows) == 149
    assert [(part.start, part.stop) for part in blocks(130)] == [(0, 64), (64, 128), (128, 130)]
