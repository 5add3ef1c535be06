"""Compiled kernels of `silhouettes` that read off a boundary made of segments: points along it, distances to it."""

from __future__ import annotations

import math

import numba
import numpy as np

LANES = 8  # pixels in a vector


@numba.njit(cache=True)
def sample(ends, edges, vertices, images, points, normals, cloth, matrix, size, border, spacing):  # type: ignore[no-untyped-def]
    """Return points every `spacing` px of the total length of segments that lie in the image, not at its border.

    Args:
        ends: (B, 2, 2) px, directed segments, the covered side on the same hand as in `occluding_edges`.
        edges: (B,) which edges they are pieces of.
        vertices: (E, 2) vertex index of the ends of the edges.
        images: (E, 2, 2) px, where these project.
        points: (N, 3) m, the vertices.
        normals: (N, 3), theirs.
        cloth: (N,) bool.
        matrix: (3, 4), px from m.
        size: (2,) px, width and height of the image.
        border: px, its width: there a silhouette is cut, not occluding.
        spacing: px.

    Returns:
        nearer vertex (K,), its image (K, 2) px, the point (K, 2) px and its unit normal outward (K, 2).
    """
    lengths = np.empty(len(ends))
    for s in range(len(ends)):
        dx, dy = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1]
        lengths[s] = math.sqrt(dx * dx + dy * dy)
    total = lengths.sum()
    most = int(total / spacing) + 1
    vertex, anchor = np.empty(most, np.int32), np.empty((most, 2))
    pixel, normal = np.empty((most, 2)), np.empty((most, 2))
    count, passed, total = 0, 0, 0.0
    for s in range(len(ends)):
        dx, dy, length, e = ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1], lengths[s], edges[s]
        while (passed + 0.5) * spacing < total + length:
            share = ((passed + 0.5) * spacing - total) / length
            passed += 1
            x, y = ends[s, 0, 0] + share * dx, ends[s, 0, 1] + share * dy
            if not (border <= x <= size[0] - 1 - border and border <= y <= size[1] - 1 - border):
                continue
            first = (images[e, 0, 0] - x) ** 2 + (images[e, 0, 1] - y) ** 2
            near = 1 if (images[e, 1, 0] - x) ** 2 + (images[e, 1, 1] - y) ** 2 < first else 0
            v = vertices[e, near]
            nx, ny = image_normal(points[v], normals[v], matrix)
            if cloth[v] or ny * dx - nx * dy <= 0:  # a rim has no such normal; nor has a vertex that is turned away
                nx, ny = -dy, dx
            norm = math.sqrt(nx * nx + ny * ny)
            vertex[count] = v
            anchor[count, 0], anchor[count, 1] = images[e, near, 0], images[e, near, 1]
            pixel[count, 0], pixel[count, 1] = x, y
            normal[count, 0], normal[count, 1] = nx / norm, ny / norm
            count += 1
        total += length
    return vertex[:count], anchor[:count], pixel[:count], normal[:count]


@numba.njit(cache=True)
def in_rows(vertex, anchor, pixel, normal):  # type: ignore[no-untyped-def]
    """Return the points of a contour in the order of their rows."""
    order = np.argsort(pixel[:, 1].copy(), kind="mergesort")
    return vertex[order], anchor[order], pixel[order], normal[order]


@numba.njit(cache=True)
def image_normal(point, normal, matrix):  # type: ignore[no-untyped-def]
    """Return how the image of a point moves with its surface normal: x and y, not of unit length."""
    x, y, w = matrix[0, 3], matrix[1, 3], matrix[2, 3]
    dx, dy, dw = 0.0, 0.0, 0.0
    for axis in range(3):
        x, dx = x + matrix[0, axis] * point[axis], dx + matrix[0, axis] * normal[axis]
        y, dy = y + matrix[1, axis] * point[axis], dy + matrix[1, axis] * normal[axis]
        w, dw = w + matrix[2, axis] * point[axis], dw + matrix[2, axis] * normal[axis]
    return (dx - x / w * dw) / w, (dy - y / w * dw) / w


@numba.njit(cache=True, error_model="numpy")
def paint_distance(ends, first, spans, band, distance):  # type: ignore[no-untyped-def]
    """Write the signed distance to the nearest segment into a field of -band; the inside beyond reach is +band.

    Args:
        ends: (B, 2, 2) px, the segments.
        first: (H + 1,), with the spans: the inside, see `span_kernels.covered`.
        spans: (S, 2) px.
        band: px, as float32.
        distance: (H, W) float32, all -band.
    """
    if not len(ends):
        return
    left, right = _reached(ends[:, :, 0], band, distance.shape[1])
    top, bottom = _reached(ends[:, :, 1], band, distance.shape[0])
    square = np.full((bottom - top, right - left), band * band)
    _lower_to_segments(ends, left, top, band, square)
    for row in range(top, bottom):
        line, away = distance[row, left:right], square[row - top]
        for k in range(line.size):
            line[k] = -min(np.sqrt(away[k]), band)
        for k in range(first[row], first[row + 1]):
            distance[row, spans[k, 0] : spans[k, 1]] *= np.float32(-1)


@numba.njit(cache=True)
def _reached(places, band, size):  # type: ignore[no-untyped-def]
    """Return the first of `size` pixels in the band around places (B, 2) along an axis, and the one after the last."""
    low = min(max(math.floor(max(places.min() - band, 0.0)), 0), size)
    return low, max(math.ceil(min(places.max() + band + 1.0, size)), low)


@numba.njit(cache=True, error_model="numpy")
def _lower_to_segments(ends, left, top, band, square):  # type: ignore[no-untyped-def]
    """Lower each element of `square` within the band to its squared distance from the segments (float32, SIMD).

    Along a segment a pixel lies beyond its ends by what its distance from the middle exceeds half the length.
    """
    zero, one, half = np.float32(0), np.float32(1), np.float32(0.5)
    columns = np.arange(square.shape[1]).astype(np.float32)
    for s in range(len(ends)):
        ax, ay = np.float32(ends[s, 0, 0] - left), np.float32(ends[s, 0, 1] - top)
        bx, by = np.float32(ends[s, 1, 0] - left), np.float32(ends[s, 1, 1] - top)
        length = np.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
        ux, uy = ((bx - ax) / length, (by - ay) / length) if length > zero else (one, zero)
        mx, my, reach = half * (ax + bx), half * (ay + by), half * length
        first = max(math.ceil(min(ay, by) - band), 0)
        last = min(math.floor(max(ay, by) + band) + 1, square.shape[0])
        begin = max(math.ceil(min(ax, bx) - band), 0)
        # whole vectors of pixels: a remainder would cost as much as two more
        end = min(begin + -(-(math.floor(max(ax, bx) + band) + 1 - begin) // LANES) * LANES, square.shape[1])
        for row in range(first, last):
            line, place = square[row, begin:end], columns[begin:end]
            py = np.float32(row) - my
            along, across = py * uy - mx * ux, py * ux + mx * uy
            for k in range(len(line)):
                beyond = abs(along + place[k] * ux) - reach
                beyond = beyond if beyond > zero else zero
                off = across - place[k] * uy
                d = off * off + beyond * beyond
                line[k] = (d if d < line[k] else line[k]) + zero  # else a masked store: slow on some machines


@numba.njit(cache=True)
def add_squared_difference(one, other, band, columns):  # type: ignore[no-untyped-def]
    """Add the squared differences of two fields (H, W), clipped to the band, to sums of their columns (W,): SIMD."""
    for row in range(len(one)):
        a, b = one[row], other[row]
        for k in range(columns.size):
            off = min(max(a[k], -band), band) - min(max(b[k], -band), band)
            columns[k] += off * off
