"""The arrays of a track that grows: a frame in the place of another is damage, however many are wanted later."""

import numpy as np
import pytest

from mocapflow.storage.growing import NUMBERS, Growing
from mocapflow.storage.rows import Corrupted

COLUMNS = {"frame": (), "angles": (2,)}
SHAPES = {"grey": (2,), "count": ()}


def numbers(frame):
    return np.array([frame, 0.5, -0.5])


def seen(frame):
    return {"grey": np.array([frame, 0.5]), "count": np.array(frame)}


def test_numbers_of_another_frame_are_damage(tmp_path):
    growing = Growing(tmp_path, range(10, 14), ("cam01",))
    for row, frame in enumerate((10, 12)):
        growing.write_numbers(row, numbers(frame))
    np.testing.assert_array_equal(growing.numbers(0, COLUMNS), numbers(10))
    with pytest.raises(Corrupted, match="frame 11 is missing"):
        growing.numbers(1, COLUMNS)


def test_of_appearances_there_are_the_last_two(tmp_path):
    """That of a frame must not be overwritten before the next one counts."""
    growing = Growing(tmp_path, range(10, 14), ("cam01",))
    for row in range(3):
        growing.write_appearance(row, seen(10.0 + row))
    for row in (1, 2):
        found = growing.appearance(row, SHAPES)
        assert all(np.array_equal(found[name], seen(10.0 + row)[name]) for name in SHAPES)
    with pytest.raises(Corrupted, match="the appearance of frame 10 is missing"):
        growing.appearance(0, SHAPES)
    assert growing.appearance(0, {}) == {}


def test_arrays_grow_with_the_frames_that_are_wanted_and_do_not_shrink(tmp_path):
    for wanted, length in ((4, 4), (6, 6), (2, 6)):
        growing = Growing(tmp_path, range(wanted), ("cam01",))
        growing.write_numbers(wanted - 1, numbers(wanted - 1))
        assert growing.array(NUMBERS).shape == (length, 3)
    assert [growing.array(NUMBERS).read(row)[0] for row in (1, 3, 5)] == [1, 3, 5]
