"""Compiled kernels of `silhouettes`: projection, occluding edges, winding numbers, the boundary."""

from __future__ import annotations

import math

import numba
import numpy as np

REACH = 1.0  # px beyond a segment at which its outside is looked up
MOST_PIECES = 2048  # of one edge: at 4 px, longer than the diagonal of any image
MOST_COLUMNS = 1e6  # of an image
NEAREST = 1e-6  # m, depth of what still counts as before the camera

index = numba.uint64  # of an array: unsigned, so that nothing is checked for counting from the end; twice as fast


@numba.njit(cache=True)
def project(vertices, matrix, pixels, depth):  # type: ignore[no-untyped-def]
    """Write pixels (N, 2), NaN behind the camera, and depths (N,) m of world points (N, 3)."""
    for v in range(len(vertices)):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        w = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        depth[v] = w
        inverse = 1.0 / w if w > NEAREST else math.nan
        pixels[v, 0] = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) * inverse
        pixels[v, 1] = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) * inverse


@numba.njit(cache=True)
def face_directions(pixels, faces, facing):  # type: ignore[no-untyped-def]
    """Write +1 for faces that look at the camera, -1 for those that look away, 0 for those (partly) behind it."""
    for f in range(len(faces)):
        a, b, c = index(faces[f, 0]), index(faces[f, 1]), index(faces[f, 2])
        ux, uy = pixels[b, 0] - pixels[a, 0], pixels[b, 1] - pixels[a, 1]
        wx, wy = pixels[c, 0] - pixels[a, 0], pixels[c, 1] - pixels[a, 1]
        area = ux * wy - wx * uy  # y points down: counterclockwise from outside is negative
        facing[f] = np.int8(area < 0) - np.int8(area > 0)


@numba.njit(cache=True)
def occluding_edges(edges, facing, cloth):  # type: ignore[no-untyped-def]
    """Return directed occluding edges (K, 2), covered side on the same hand, and how many layers end there (K,).

    A face covers if it looks at the camera; cloth covers with both its sides, and counts negative turned over.
    """
    out = np.empty((len(edges), 2), np.int32)
    times = np.empty(len(edges), np.int32)
    count = 0
    for e in range(len(edges)):
        a, b, left, right = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        here = facing[index(left)] if left >= 0 else 0
        there = facing[index(right)] if right >= 0 else 0
        if here == there:  # nearly all
            continue
        if not cloth[index(a)]:
            here, there = max(here, 0), max(there, 0)
        ends = here - there
        if ends == 0:
            continue
        out[count, 0], out[count, 1] = (a, b) if ends > 0 else (b, a)
        times[count] = abs(ends)
        count += 1
    return out[:count], times[:count]


@numba.njit(cache=True)
def crossings(ends, times, height):  # type: ignore[no-untyped-def]
    """Return where directed segments cross the rows of an image: the first column behind, and how many layers begin.

    Those of a row are the elements first[row] to first[row + 1], in no order.
    """
    first = np.zeros(height + 2, np.int64)
    for s in range(len(ends)):
        for row in range(*_rows(ends[s, 0, 1], ends[s, 1, 1], height)):
            first[row + 2] += 1
    first = np.cumsum(first)
    column, layers = np.empty(first[-1], np.int32), np.empty(first[-1], np.int32)
    for s in range(len(ends)):
        x0, y0, x1, y1 = ends[s, 0, 0], ends[s, 0, 1], ends[s, 1, 0], ends[s, 1, 1]
        slope = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
        for row in range(*_rows(y0, y1, height)):
            c = first[row + 1]
            first[row + 1] += 1
            column[c] = math.ceil(min(max(x0 + slope * (row - y0), 0.0), MOST_COLUMNS))
            layers[c] = times[s] if y1 > y0 else -times[s]
    return first[:-1], column, layers


@numba.njit(cache=True)
def _rows(one, other, height):  # type: ignore[no-untyped-def]
    """Return the first and last-but-one row of an image between two heights."""
    return max(math.ceil(min(one, other)), 0), min(math.ceil(max(one, other)), height)


@numba.njit(cache=True)
def wind(first, column, layers, corner, cover):  # type: ignore[no-untyped-def]
    """Write the number of layers over each pixel of a crop, all zero before."""
    for row in range(cover.shape[0]):
        for c in range(first[corner[1] + row], first[corner[1] + row + 1]):
            at = max(column[c] - corner[0], 0)
            if at < cover.shape[1]:
                cover[row, at] += layers[c]
        over = 0
        for at in range(cover.shape[1]):
            over += cover[row, at]
            cover[row, at] = over


@numba.njit(cache=True)
def bounds(ends):  # type: ignore[no-untyped-def]
    """Return the least and greatest x and y of segments: ((x, y), (x, y)) px."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for s in range(len(ends)):
        for axis in range(2):
            low[axis] = min(low[axis], ends[s, 0, axis], ends[s, 1, axis])
            high[axis] = max(high[axis], ends[s, 0, axis], ends[s, 1, axis])
    return low, high


@numba.njit(cache=True)
def boundary(ends, times, size, longest):  # type: ignore[no-untyped-def]
    """Return the pieces of directed segments with nothing beyond them: their segment (B,) and their ends (B, 2, 2).

    Segments are judged in equal pieces no longer than `longest` px; one that all but touches the plane of a camera
    is cut into no more than MOST_PIECES. Nothing is drawn: layers are counted where they are asked for.
    """
    counts = np.empty(len(ends), np.int64)
    for s in range(len(ends)):
        dx, dy = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1]
        counts[s] = max(math.ceil(min(math.sqrt(dx * dx + dy * dy) / longest, MOST_PIECES)), 1)
    whole, pieces = np.empty(counts.sum(), np.int32), np.empty((counts.sum(), 2, 2))
    first, column, layers = crossings(ends, times, size[1])
    count = 0
    for s in range(len(ends)):
        x, y = ends[s, 0, 0], ends[s, 0, 1]
        dx, dy = (ends[s, 1, 0] - x) / counts[s], (ends[s, 1, 1] - y) / counts[s]
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        for k in range(counts[s]):
            beyond_x, beyond_y = x + (k + 0.5) * dx - REACH * dy / length, y + (k + 0.5) * dy + REACH * dx / length
            at, row = math.floor(beyond_x + 0.5), math.floor(beyond_y + 0.5)
            covered = np.int32(0)
            if 0 <= at < size[0] and 0 <= row < size[1]:
                begin, end = first[row], first[row + 1]
                places, ending = column[begin:end], layers[begin:end]
                for c in range(places.size):
                    covered += ending[c] if places[c] <= np.int32(at) else np.int32(0)
            if covered == 0:
                whole[count] = s
                pieces[count, 0, 0], pieces[count, 0, 1] = x + k * dx, y + k * dy
                pieces[count, 1, 0], pieces[count, 1, 1] = x + (k + 1) * dx, y + (k + 1) * dy
                count += 1
    return whole[:count], pieces[:count]
