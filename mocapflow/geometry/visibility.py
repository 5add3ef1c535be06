"""Which part of a surface is seen at a pixel: depth tests at some hundred points, without an image of depths."""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry import silhouette_kernels as kernels
from mocapflow.geometry.cameras import projection
from mocapflow.records import F64, I32


def front_vertices(surface: Surface, camera: Camera, points: F64) -> tuple[I32, F64]:
    """Return what is seen at points (P, 2) px of a view.

    Returns:
        vertex (P,): the nearest corner of the foremost triangle over each point, -1 where there is none;
        image (N, 2) px: where every vertex of the surface projects.
    """
    image, depth = np.empty((len(surface.vertices), 2)), np.empty(len(surface.vertices))
    kernels.project(surface.vertices, projection(camera), image, depth)
    vertex = np.full(len(points), -1, np.int32)
    if len(points):
        low = np.floor(points.min(axis=0)).astype(np.int64)
        width, height = (np.floor(points.max(axis=0)).astype(np.int64) - low + 1).tolist()
        first, after = _in_cells(points, low, np.full((height, width), -1, np.int32))
        _front(image, depth, surface.faces, points, low, first, after, vertex)
    return vertex, image


@numba.njit(cache=True)
def _in_cells(points, low, first):  # type: ignore[no-untyped-def]
    """Return, as linked lists, the points in each pixel: the first one, and which one comes after each."""
    after = np.full(len(points), -1, np.int32)
    for p in range(len(points)):
        column, row = math.floor(points[p, 0]) - low[0], math.floor(points[p, 1]) - low[1]
        after[p] = first[row, column]
        first[row, column] = p
    return first, after


@numba.njit(cache=True)
def _front(image, depth, faces, points, low, first, after, vertex):  # type: ignore[no-untyped-def]
    height, width = first.shape
    nearest = np.zeros(len(points))  # one over the depth, which is linear in the image
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if min(depth[a], depth[b], depth[c]) <= 1e-6:
            continue
        ax, ay, bx, by, cx, cy = image[a, 0], image[a, 1], image[b, 0], image[b, 1], image[c, 0], image[c, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        left, right = max(math.floor(min(ax, bx, cx)) - low[0], 0), min(math.floor(max(ax, bx, cx)) - low[0], width - 1)
        top, bottom = (
            max(math.floor(min(ay, by, cy)) - low[1], 0),
            min(math.floor(max(ay, by, cy)) - low[1], height - 1),
        )
        if area == 0.0:
            continue
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                p = first[row, column]
                while p >= 0:
                    x, y = points[p, 0], points[p, 1]
                    wa = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                    wb = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                    wc = 1.0 - wa - wb
                    if min(wa, wb, wc) >= 0.0:
                        inverse = wa / depth[a] + wb / depth[b] + wc / depth[c]
                        if inverse > nearest[p]:
                            nearest[p] = inverse
                            vertex[p] = a if wa >= max(wb, wc) else (b if wb >= wc else c)
                    p = after[p]
