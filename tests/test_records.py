"""Rows of records: some of one, and those of several as one."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, I32, array, joined_rows, picked_rows, record


@record
class Marks:
    """Places with numbers, of one camera."""

    camera: str
    number: I32 = array("K", unit="1")
    place: F64 = array("K", 2, unit="px")


MARKS = Marks(camera="cam01", number=np.arange(4, dtype=np.int32), place=np.arange(8.0).reshape(4, 2))


def test_some_rows_keep_what_is_no_array():
    found = picked_rows(MARKS, MARKS.number % 2 == 1)
    assert (found.camera, found.number.tolist(), found.place.tolist()) == ("cam01", [1, 3], [[2, 3], [6, 7]])


def test_rows_of_several_are_joined_in_order():
    first, rest = picked_rows(MARKS, np.array([0])), picked_rows(MARKS, np.array([1, 2, 3]))
    found = joined_rows([rest, first])
    assert (found.number.tolist(), found.place[3].tolist()) == ([1, 2, 3, 0], [0, 1])
