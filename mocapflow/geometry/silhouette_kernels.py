"""Compiled kernels of `silhouettes`: projection, occluding edges, the boundary."""

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
def boundary(ends, layers, first, spans, longest):  # type: ignore[no-untyped-def]
    """Return the pieces of directed segments where what spans cover ends: their segment (B,) and their ends (B, 2, 2).

    Segments at which no layer ends are left out. They are judged in equal pieces no longer than `longest` px; one
    that all but touches the plane of a camera is cut into no more than MOST_PIECES.
    """
    counts = np.zeros(len(ends), np.int64)
    for s in range(len(ends)):
        dx, dy = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1]
        if layers[s] and (dx or dy):
            counts[s] = max(math.ceil(min(math.sqrt(dx * dx + dy * dy) / longest, MOST_PIECES)), 1)
    edge, pieces = np.empty(counts.sum(), np.int32), np.empty((counts.sum(), 2, 2))
    count = 0
    for s in range(len(ends)):
        if counts[s] == 0:
            continue
        x, y, share = ends[s, 0, 0], ends[s, 0, 1], 1.0 / counts[s]
        dx, dy = share * (ends[s, 1, 0] - x), share * (ends[s, 1, 1] - y)
        reach = REACH / math.sqrt(dx * dx + dy * dy)
        for k in range(counts[s]):
            column = math.floor(x + (k + 0.5) * dx - reach * dy + 0.5)
            row = math.floor(y + (k + 0.5) * dy + reach * dx + 0.5)
            inside = False
            if 0 <= row < len(first) - 1:
                for c in range(first[row], first[row + 1]):
                    inside |= spans[c, 0] <= column < spans[c, 1]
            if not inside:
                edge[count] = s
                pieces[count, 0, 0], pieces[count, 0, 1] = x + k * dx, y + k * dy
                pieces[count, 1, 0], pieces[count, 1, 1] = x + (k + 1) * dx, y + (k + 1) * dy
                count += 1
    return edge[:count].copy(), pieces[:count].copy()
