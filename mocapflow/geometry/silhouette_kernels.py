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
def wind(ends, times, corner, cover):  # type: ignore[no-untyped-def]
    """Add up directed segments to the number of layers over each pixel of the crop."""
    height, width = cover.shape
    for s in range(len(ends)):
        x0, y0 = ends[s, 0, 0] - corner[0], ends[s, 0, 1] - corner[1]
        x1, y1 = ends[s, 1, 0] - corner[0], ends[s, 1, 1] - corner[1]
        sign = times[s]
        if y0 > y1:
            x0, y0, x1, y1, sign = x1, y1, x0, y0, -sign
        first, last = max(math.ceil(y0), 0), min(math.ceil(y1), height)
        slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
        for row in range(first, last):
            column = max(math.ceil(x0 + slope * (row - y0)), 0)
            if column < width:
                cover[row, column] += sign
    for row in range(height):
        layers = 0
        for column in range(width):
            layers += cover[row, column]
            cover[row, column] = layers


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
def split(ends, longest):  # type: ignore[no-untyped-def]
    """Return segments cut into equal pieces no longer than `longest` px: their segment (P,) and ends (P, 2, 2).

    An edge that all but touches the plane of a camera is cut into no more than MOST_PIECES.
    """
    counts = np.empty(len(ends), np.int64)
    for s in range(len(ends)):
        length = math.hypot(ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1])
        counts[s] = max(math.ceil(min(length / longest, MOST_PIECES)), 1)
    total = counts.sum()
    whole, pieces = np.empty(total, np.int64), np.empty((total, 2, 2))
    piece = 0
    for s in range(len(ends)):
        for k in range(counts[s]):
            whole[piece] = s
            for axis in range(2):
                reach = ends[s, 1, axis] - ends[s, 0, axis]
                pieces[piece, 0, axis] = ends[s, 0, axis] + reach * k / counts[s]
                pieces[piece, 1, axis] = ends[s, 0, axis] + reach * (k + 1) / counts[s]
            piece += 1
    return whole, pieces


@numba.njit(cache=True)
def on_boundary(ends, corner, cover):  # type: ignore[no-untyped-def]
    """Return which segments have nothing beyond them: the boundary of the covered region."""
    height, width = cover.shape
    outer = np.zeros(len(ends), np.bool_)
    for s in range(len(ends)):
        dx, dy = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        x = 0.5 * (ends[s, 0, 0] + ends[s, 1, 0]) - REACH * dy / length - corner[0]
        y = 0.5 * (ends[s, 0, 1] + ends[s, 1, 1]) + REACH * dx / length - corner[1]
        column, row = int(round(x)), int(round(y))
        outer[s] = not (0 <= column < width and 0 <= row < height) or cover[row, column] == 0
    return outer
