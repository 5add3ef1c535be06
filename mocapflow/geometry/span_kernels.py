"""Compiled kernels of `silhouettes`: what directed edges wind about, as spans of pixels in each row of the image."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def crossings(ends, size):  # type: ignore[no-untyped-def]
    """Return where directed segments cross the rows of an image: the column behind, and which segment it is.

    Those of a row are the elements begin[row] to begin[row + 1], in the order of their columns. A segment that runs
    up, with what it covers before it, is given as -1 - segment.
    """
    begin = np.zeros(size[1] + 1, np.int32)
    for s in range(len(ends)):
        for row in range(*_rows(ends[s, 0, 1], ends[s, 1, 1], size[1])):
            begin[row + 1] += 1
    for row in range(size[1]):
        begin[row + 1] += begin[row]
    end = begin[:-1].copy()  # of what is there so far
    column, segment = np.empty(begin[-1], np.int32), np.empty(begin[-1], np.int32)
    right = float(size[0])
    for s in range(len(ends)):
        x0, y0, x1, y1 = ends[s, 0, 0], ends[s, 0, 1], ends[s, 1, 0], ends[s, 1, 1]
        slope = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
        for row in range(*_rows(y0, y1, size[1])):
            at = math.ceil(min(max(x0 + slope * (row - y0), 0.0), right))
            last = end[row]
            while last > begin[row] and column[last - 1] > at:
                column[last], segment[last] = column[last - 1], segment[last - 1]
                last -= 1
            column[last], segment[last] = at, s if y1 > y0 else -1 - s
            end[row] += 1
    return begin, column, segment


@numba.njit(cache=True)
def _rows(one, other, height):  # type: ignore[no-untyped-def]
    """Return the first row of an image between two heights, and the one after the last."""
    return max(math.ceil(min(one, other)), 0), min(math.ceil(max(one, other)), height)


@numba.njit(cache=True)
def covered(begin, column, segment, layers, width):  # type: ignore[no-untyped-def]
    """Return the pixels that segments wind about, row by row, from their crossings and how many layers end at each.

    Returns:
        first (height + 1,) and spans (S, 2): those of a row are the elements first[row] to first[row + 1], each a
        first column and the one after the last.
    """
    first, spans, count = np.zeros(len(begin), np.int32), np.empty((len(column), 2), np.int32), 0
    for row in range(len(begin) - 1):
        over = 0
        for c in range(begin[row], begin[row + 1]):
            before, s = over, segment[c]
            over += layers[s] if s >= 0 else -layers[-1 - s]
            if before <= 0 < over:
                spans[count, 0] = column[c]
            elif over <= 0 < before and column[c] > spans[count, 0]:
                spans[count, 1] = column[c]
                count += 1
        if over > 0:  # what ends behind the camera is open
            spans[count, 1] = width
            count += 1
        first[row + 1] = count
    return first, spans[:count].copy()


@numba.njit(cache=True)
def fill(first, spans, mask):  # type: ignore[no-untyped-def]
    """Set the pixels of a mask (H, W) that spans cover, see `covered`."""
    for row in range(len(mask)):
        for k in range(first[row], first[row + 1]):
            mask[row, spans[k, 0] : spans[k, 1]] = True
