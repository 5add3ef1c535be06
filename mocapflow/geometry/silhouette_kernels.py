"""Compiled kernels of `silhouettes`: projection, occluding edges, winding numbers, the boundary."""

from __future__ import annotations

import math

import numba
import numpy as np

REACH = 1.0  # px beyond a segment at which its outside is looked up
MOST_PIECES = 2048  # of one edge: at 4 px, longer than the diagonal of any image
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
def boundary(ends, times, size, longest):  # type: ignore[no-untyped-def]
    """Return what directed segments cover, row by row, and the pieces of them with nothing beyond.

    Segments are judged in equal pieces no longer than `longest` px; one that all but touches the plane of a camera
    is cut into no more than MOST_PIECES.

    Returns:
        first (height + 1,) and spans (S, 2): see `covered`; the segment (B,) and the ends (B, 2, 2) of the pieces.
    """
    counts = np.empty(len(ends), np.int64)
    for s in range(len(ends)):
        dx, dy = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1]
        counts[s] = max(math.ceil(min(math.sqrt(dx * dx + dy * dy) / longest, MOST_PIECES)), 1)
    whole, pieces = np.empty(counts.sum(), np.int32), np.empty((counts.sum(), 2, 2))
    first, spans = covered(ends, times, size)
    count = 0
    for s in range(len(ends)):
        x, y = ends[s, 0, 0], ends[s, 0, 1]
        dx, dy = (ends[s, 1, 0] - x) / counts[s], (ends[s, 1, 1] - y) / counts[s]
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        for k in range(counts[s]):
            column = math.floor(x + (k + 0.5) * dx - REACH * dy / length + 0.5)
            row = math.floor(y + (k + 0.5) * dy + REACH * dx / length + 0.5)
            if not (0 <= row < size[1] and _within(column, spans, first[row], first[row + 1])):
                whole[count] = s
                pieces[count, 0, 0], pieces[count, 0, 1] = x + k * dx, y + k * dy
                pieces[count, 1, 0], pieces[count, 1, 1] = x + (k + 1) * dx, y + (k + 1) * dy
                count += 1
    return first, spans, whole[:count].copy(), pieces[:count].copy()


@numba.njit(cache=True)
def _within(column, spans, begin, end):  # type: ignore[no-untyped-def]
    inside = False
    for k in range(begin, end):
        inside |= spans[k, 0] <= column < spans[k, 1]
    return inside


@numba.njit(cache=True)
def covered(ends, times, size):  # type: ignore[no-untyped-def]
    """Return the pixels of an image that directed segments wind about, row by row.

    Returns:
        first (height + 1,) and spans (S, 2): those of a row are the elements first[row] to first[row + 1], each a
        first column and the one after the last.
    """
    begin, column, layers = _crossings(ends, times, size)
    first, spans, count = np.zeros(size[1] + 1, np.int32), np.empty((len(column), 2), np.int32), 0
    for row in range(size[1]):
        over = 0
        for c in range(begin[row], begin[row + 1]):
            before, over = over, over + layers[c]
            if before <= 0 < over:
                spans[count, 0] = column[c]
            elif over <= 0 < before and column[c] > spans[count, 0]:
                spans[count, 1] = column[c]
                count += 1
        if over > 0:  # what ends behind the camera is open
            spans[count, 1] = size[0]
            count += 1
        first[row + 1] = count
    return first, spans[:count].copy()


@numba.njit(cache=True)
def _crossings(ends, times, size):  # type: ignore[no-untyped-def]
    """Return where directed segments cross the rows of an image: the column behind, and how many layers begin there.

    Those of a row are the elements begin[row] to begin[row + 1], in the order of their columns.
    """
    begin = np.zeros(size[1] + 1, np.int64)
    for s in range(len(ends)):
        for row in range(*_rows(ends[s, 0, 1], ends[s, 1, 1], size[1])):
            begin[row + 1] += 1
    begin = np.cumsum(begin)
    end = begin[:-1].copy()  # of what is there so far
    column, layers = np.empty(begin[-1], np.int32), np.empty(begin[-1], np.int32)
    right = float(size[0])
    for s in range(len(ends)):
        x0, y0, x1, y1 = ends[s, 0, 0], ends[s, 0, 1], ends[s, 1, 0], ends[s, 1, 1]
        slope = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
        for row in range(*_rows(y0, y1, size[1])):
            at = math.ceil(min(max(x0 + slope * (row - y0), 0.0), right))
            last = end[row]
            while last > begin[row] and column[last - 1] > at:
                column[last], layers[last] = column[last - 1], layers[last - 1]
                last -= 1
            column[last], layers[last] = at, times[s] if y1 > y0 else -times[s]
            end[row] += 1
    return begin, column, layers


@numba.njit(cache=True)
def _rows(one, other, height):  # type: ignore[no-untyped-def]
    """Return the first and last-but-one row of an image between two heights."""
    return max(math.ceil(min(one, other)), 0), min(math.ceil(max(one, other)), height)
