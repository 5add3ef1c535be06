"""The contour of an image silhouette: sub-pixel zero crossings of its signed distance, with normals."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.records import F32, F64

WORD = 8  # cells looked at together


def zero_crossings(distance: F32, border_px: int) -> tuple[F64, F64]:
    """Return where a signed distance crosses zero between neighbouring pixels, all components and holes included.

    Args:
        distance: (H, W) px, positive inside.
        border_px: crossings nearer to the image border are left out: there a silhouette is cut, not occluding.

    Returns:
        pixels (K, 2) in the order of their rows, and unit normals (K, 2) that point out of the silhouette; about
        4/pi of them per pixel of contour.
    """
    pixel, normal = _crossings(distance, border_px)
    order = np.argsort(pixel[:, 1], kind="stable")
    return pixel[order], normal[order]


@numba.njit(cache=True)
def _crossings(distance, border):  # type: ignore[no-untyped-def]
    height, width = distance.shape
    capacity = 4096
    pixel, normal = np.empty((capacity, 2)), np.empty((capacity, 2))
    count = 0
    crossed = np.zeros(width // WORD + 1, np.uint64)
    cells = crossed.view(np.uint8)
    for row in range(border, height - border - 1):
        find_crossed(distance[row], distance[row + 1], cells)
        for word in range(crossed.size):
            if crossed[word] == 0:
                continue
            for column in range(max(word * WORD, border), min((word + 1) * WORD, width - border - 1)):
                here = distance[row, column]
                for down in range(2):
                    there = distance[row + down, column + 1 - down]
                    if (here > 0) == (there > 0):
                        continue
                    t = here / (here - there)
                    ahead = row + down, column + 1 - down
                    gx = (1 - t) * _slope(distance, row, column, 0) + t * _slope(distance, ahead[0], ahead[1], 0)
                    gy = (1 - t) * _slope(distance, row, column, 1) + t * _slope(distance, ahead[0], ahead[1], 1)
                    length = np.sqrt(gx * gx + gy * gy)
                    if length == 0.0:
                        continue
                    if count == capacity:
                        pixel, normal = np.concatenate((pixel, pixel)), np.concatenate((normal, normal))
                        capacity *= 2
                    pixel[count, 0], pixel[count, 1] = column + (1 - down) * t, row + down * t
                    normal[count, 0], normal[count, 1] = -gx / length, -gy / length
                    count += 1
    return pixel[:count], normal[:count]


@numba.njit(cache=True)
def find_crossed(above, below, cells):  # type: ignore[no-untyped-def]
    """Mark the cells between two rows (W,) whose corners lie on both sides of a contour, each in a byte of `cells`.

    Without branches, and in bytes, so that it vectorises; a word of eight cells is then looked at together.
    """
    for x in range(above.size - 1):
        side = above[x] > 0
        cells[x] = (side ^ (above[x + 1] > 0)) | (side ^ (below[x + 1] > 0)) | (side ^ (below[x] > 0))


@numba.njit(cache=True)
def _slope(distance, row, column, axis):  # type: ignore[no-untyped-def]
    if axis == 0:
        return distance[row, column + 1] - distance[row, column - 1]
    return distance[row + 1, column] - distance[row - 1, column]


@numba.njit(cache=True)
def nearest_compatible(points, normals, others, other_normals, reach, least_cosine):  # type: ignore[no-untyped-def]
    """Return, for each point, the nearest other within reach whose normal agrees, or -1.

    Points (N, 2 + F) px and others have features in the columns after x and y, which add to the distance. The others
    are visited outward from the point's row in the order of their rows (they must be sorted by y; it is fast where the
    points are, too).
    """
    found = np.full(len(points), -1, np.int32)
    rows = others[:, 1].copy()
    start = 0  # the first row that is not above the point
    for p in range(len(points)):
        x, y = points[p, 0], points[p, 1]
        best = reach * reach
        while start < len(rows) and rows[start] < y:
            start += 1
        while start > 0 and rows[start - 1] >= y:
            start -= 1
        for direction in (-1, 1):
            k = start - 1 if direction < 0 else start
            while 0 <= k < len(others):
                dy = rows[k] - y
                if dy * dy >= best:
                    break
                dx = others[k, 0] - x
                d = dx * dx + dy * dy
                for feature in range(2, points.shape[1]):
                    d += (others[k, feature] - points[p, feature]) ** 2
                if d < best:
                    cosine = normals[p, 0] * other_normals[k, 0] + normals[p, 1] * other_normals[k, 1]
                    if cosine >= least_cosine:
                        best = d
                        found[p] = k
                k += direction
    return found


@numba.njit(cache=True)
def pairs(one, normals, other, other_normals, reach, least_cosine, forward, backward):  # type: ignore[no-untyped-def]
    """Return which points of one contour and of another, both sorted by row, make pairs: two indices (M,).

    Forward every point of the one takes its nearest compatible of the other, backward the other way round.
    """
    first, second = np.empty(len(one) + len(other), np.int32), np.empty(len(one) + len(other), np.int32)
    count = 0
    if forward:
        found = nearest_compatible(one, normals, other, other_normals, reach, least_cosine)
        for p in range(len(found)):
            if found[p] >= 0:
                first[count], second[count] = p, found[p]
                count += 1
    if backward:
        found = nearest_compatible(other, other_normals, one, normals, reach, least_cosine)
        for p in range(len(found)):
            if found[p] >= 0:
                first[count], second[count] = found[p], p
                count += 1
    return first[:count], second[:count]


@numba.njit(cache=True)
def at_nearest(field, pixels):  # type: ignore[no-untyped-def]
    """Return a field (H, W) at the pixels nearest to points (K, 2) px; outside the image those at its edge."""
    height, width = field.shape
    values = np.empty(len(pixels))
    for k in range(len(pixels)):
        column = min(max(int(np.rint(pixels[k, 0])), 0), width - 1)
        values[k] = field[min(max(int(np.rint(pixels[k, 1])), 0), height - 1), column]
    return values
