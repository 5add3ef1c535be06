"""Signed distance to the zero contour of a level set, sub-pixel and only within a band.

The contour is the marching-squares polyline. Each of its segments stamps exact distances into the square of
pixels within the band around it; the smallest stays. Rows of a stamp are contiguous, so the loop vectorises.
"""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.geometry.boundary_kernels import LANES
from mocapflow.geometry.contours import WORD, find_crossed
from mocapflow.records import F32


def redistance(level: F32, band_px: float) -> F32:
    """Return the signed distance (H, W) px to the zero contour of `level`, same sign, clipped to the band.

    The contour stays where linear interpolation puts it: a distance transform of the mask would snap it to
    pixel borders and pin the front.
    """
    squared = np.empty_like(level)
    distance: F32 = _redistance(level, np.float32(band_px), squared)
    return distance


@numba.njit(cache=True, error_model="numpy")
def _redistance(level, band, out):  # type: ignore[no-untyped-def]
    """Fill `out` with signed distances: stamp squared distances first, then root and sign."""
    height, width = level.shape
    far = band * band
    out[:] = far
    reach = int(np.ceil(band))
    points = np.empty((4, 2), np.float32)
    crossed = np.zeros(width // WORD + 1, np.uint64)
    cells = crossed.view(np.uint8)
    for y in range(height - 1):
        find_crossed(level[y], level[y + 1], cells)
        for word in range(crossed.size):
            if crossed[word] == 0:
                continue
            for x in range(word * WORD, (word + 1) * WORD):
                if cells[x]:
                    a, b, c, d = level[y, x], level[y, x + 1], level[y + 1, x + 1], level[y + 1, x]
                    count = _crossings(a, b, c, d, np.float32(x), np.float32(y), points)
                    _stamp(out, points, 0, 1, x, y, reach)
                    if count == 4:
                        _stamp(out, points, 2, 3, x, y, reach)
    for y in range(height):
        for x in range(width):
            distance = np.sqrt(min(out[y, x], far))
            out[y, x] = max(distance, np.float32(1e-6)) if level[y, x] > 0 else -distance
    return out


@numba.njit(cache=True, error_model="numpy")
def _crossings(a, b, c, d, x, y, points):  # type: ignore[no-untyped-def]
    """Write the contour's crossings of a cell's edges (clockwise from the top left corner), paired as segments."""
    one = np.float32(1)
    count = 0
    if (a > 0) != (b > 0):
        points[count, 0], points[count, 1] = x + a / (a - b), y
        count += 1
    if (b > 0) != (c > 0):
        points[count, 0], points[count, 1] = x + one, y + b / (b - c)
        count += 1
    if (c > 0) != (d > 0):
        points[count, 0], points[count, 1] = x + d / (d - c), y + one
        count += 1
    if (d > 0) != (a > 0):
        points[count, 0], points[count, 1] = x, y + a / (a - d)
        count += 1
    # saddle: the segments (top, right) and (bottom, left) enclose b and d; if the centre belongs to the side of
    # b and d, the segments enclose a and c instead
    if count == 4 and ((a + b + c + d > 0) == (b > 0)):
        right_x, right_y = points[1, 0], points[1, 1]
        points[1, 0], points[1, 1] = points[3, 0], points[3, 1]
        points[3, 0], points[3, 1] = right_x, right_y
    return count


@numba.njit(cache=True, error_model="numpy")
def _stamp(out, points, i, j, x, y, reach):  # type: ignore[no-untyped-def]
    """Lower the squared distances around cell (x, y) to those of the segment from point i to point j.

    Along the segment a pixel is `along` from its middle and beyond its ends by what that exceeds half its length;
    across it is `across` away.
    """
    height, width = out.shape
    # whole vectors of pixels: a remainder would cost as much as another vector
    left = max(x - reach, 0)
    right = min(left + (2 * reach + 2 + LANES - 1) // LANES * LANES, width)
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    length, zero = np.sqrt(dx * dx + dy * dy), np.float32(0)
    half = np.float32(0.5) * length
    # a point has no direction; any will do
    ux, uy = (dx / length, dy / length) if length > zero else (np.float32(1), zero)
    mx = np.float32(0.5) * (points[i, 0] + points[j, 0]) - np.float32(left)
    my = np.float32(0.5) * (points[i, 1] + points[j, 1])
    for row in range(max(y - reach, 0), min(y + reach + 2, height)):
        ey = np.float32(row) - my
        first_along, first_across = ey * uy - mx * ux, ey * ux + mx * uy
        line = out[row, left:right]
        for k in range(line.size):
            place = np.float32(np.int32(k))
            beyond = abs(first_along + place * ux) - half
            beyond = beyond if beyond > zero else zero
            across = first_across - place * uy
            squared = across * across + beyond * beyond
            line[k] = (squared if squared < line[k] else line[k]) + zero  # else a masked store: slow on some machines
