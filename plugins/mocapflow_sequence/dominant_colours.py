"""The dominant colours of every pixel over pictures of a camera that stands still."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.io.recording.plates import LEAST_SPREAD, NORMAL
from mocapflow.records import F32, U8, Bool
from mocapflow_sequence.colours import Colours

SAME = 4.0  # standard deviations of the noise within which a pixel has the same colour in two pictures
LEAST_SAME = 6.0  # grey levels: compressed pictures differ by so much where nothing moves


def dominant_colours(pictures: U8, count: int, counted: Bool | None = None) -> list[Colours]:
    """Return the dominant colours of each pixel, the most common first.

    Args:
        pictures: (N, H, W, 3), of one camera; what moves covers each pixel in some of them only.
        count: how many.
        counted: (N, H, W) which pixels of which pictures tell; None: all do.
    """
    within = np.maximum(SAME * np.sqrt(2) * noise(pictures), LEAST_SAME).astype(np.int32)
    shape = (count, *pictures.shape[1:])
    mean, spread = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    share = np.zeros(shape[:3], np.float32)
    counted = np.ones(pictures.shape[:3], bool) if counted is None else counted
    _dominant_colours(pictures, counted, within, mean, spread, share)
    spread = np.maximum(spread, np.maximum(np.median(spread[0], axis=(0, 1)), LEAST_SPREAD), dtype=np.float32)
    return [Colours(*view) for view in zip(mean, spread, share, strict=True)]


def noise(pictures: U8) -> F32:
    """Return the standard deviation (3,) of the noise, by what changes where nothing moves, as in most of a picture."""
    steps = np.abs(np.diff(pictures[:, ::4, ::4].astype(np.float32), axis=0))
    return np.asarray(NORMAL * np.median(steps, axis=(0, 1, 2)) / np.sqrt(2), np.float32)


@numba.njit(cache=True, error_model="numpy")
def _dominant_colours(pictures, counted, within, mean, spread, share):  # type: ignore[no-untyped-def]
    number, height, width, _ = pictures.shape
    row, left = np.empty((width, number, 3), np.int32), np.empty(number, np.bool_)
    for y in range(height):
        for j in range(number):  # a pixel's values side by side
            row[:, j] = pictures[j, y]
        for x in range(width):
            for j in range(number):
                left[j] = counted[j, y, x]
            for k in range(len(mean)):
                best, count = _seed(row[x], within, left)
                if not count:
                    break
                share[k, y, x] = count / number
                _describe(row[x], best, within, left, mean[k, y, x], spread[k, y, x])


@numba.njit(cache=True, error_model="numpy")
def _seed(values, within, left):  # type: ignore[no-untyped-def]
    """Return which of the values (N, 3) that are left has most others like it, and how many; 0 where none is left."""
    best, count, remaining = -1, 0, left.sum()
    for i in range(len(values)):
        if 2 * count > remaining:
            break
        if not left[i] or (best >= 0 and _same(values[i], values[best], within)):
            continue
        found = 0
        for j in range(len(values)):
            found += left[j] and _same(values[i], values[j], within)
        if found > count:
            best, count = i, found
    return best, count


@numba.njit(cache=True, error_model="numpy")
def _describe(values, best, within, left, mean, spread):  # type: ignore[no-untyped-def]
    """Write mean and spread (3,) of what is left like the best of some values (N, 3), and take it out."""
    count = 0
    mean[:], spread[:] = 0, 0
    for j in range(len(values)):
        if left[j] and _same(values[best], values[j], within):
            count, left[j] = count + 1, False
            for c in range(3):  # off the best, so that the sum of squares is exact
                off = np.float32(values[j, c] - values[best, c])
                mean[c] += off
                spread[c] += off * off
    for c in range(3):
        mean[c] /= count
        spread[c] = np.sqrt(max(spread[c] / count - mean[c] * mean[c], np.float32(0)))
        mean[c] += values[best, c]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _same(one, other, within):  # type: ignore[no-untyped-def]
    for c in range(3):
        off = one[c] - other[c]
        if off > within[c] or off < -within[c]:
            return False
    return True
