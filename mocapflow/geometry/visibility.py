"""Which part of a surface is seen at a pixel: depth tests at some hundred points, without an image of depths."""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.silhouette_kernels import NEAREST, index
from mocapflow.geometry.silhouettes import projected
from mocapflow.records import F64, I32

CELL = 4.0  # px, about the size of a face: points are looked up by squares of this size
BEHIND = 1 << 24  # cell of what is behind the camera


def front_vertices(surface: Surface, camera: Camera, points: F64) -> tuple[I32, F64]:
    """Return what is seen at points (P, 2) px of a view; skin shows its outside alone, cloth both sides.

    Returns:
        vertex (P,): the nearest corner of the foremost triangle over each point, -1 where there is none;
        image (N, 2) px: where every vertex of the surface projects.
    """
    view = projected(surface, camera)
    vertex = np.full(len(points), -1, np.int32)
    if len(points):
        low = np.floor(points.min(axis=0) / CELL).astype(np.int64)
        width, height = (np.floor(points.max(axis=0) / CELL).astype(np.int64) - low + 1).tolist()
        first, after = _in_cells(points, low, np.full((height, width), -1, np.int32))
        _front(view.image, view.depth, view.facing, surface.faces, surface.cloth, points, low, first, after, vertex)
    return vertex, view.image


@numba.njit(cache=True)
def _in_cells(points, low, first):  # type: ignore[no-untyped-def]
    """Return, as linked lists, the points in each cell: the first one, and which one comes after each."""
    after = np.full(len(points), -1, np.int32)
    for p in range(len(points)):
        column, row = math.floor(points[p, 0] / CELL) - low[0], math.floor(points[p, 1] / CELL) - low[1]
        after[p] = first[row, column]
        first[row, column] = p
    return first, after


@numba.njit(cache=True, error_model="numpy")
def _front(image, depth, facing, faces, cloth, points, low, first, after, vertex):  # type: ignore[no-untyped-def]
    height, width = first.shape
    cells = np.full((len(image), 2), BEHIND, np.int32)  # of every vertex
    for v in range(len(image)):
        if depth[v] > NEAREST:
            cells[v, 0], cells[v, 1] = math.floor(image[v, 0] / CELL) - low[0], math.floor(image[v, 1] / CELL) - low[1]
    nearest = np.zeros(len(points))  # one over the depth, which is linear in the image
    for f in range(len(faces)):
        a, b, c = index(faces[f, 0]), index(faces[f, 1]), index(faces[f, 2])
        if facing[f] == 0 or (facing[f] < 0 and not cloth[a]):
            continue
        (ax, ay), (bx, by), (cx, cy) = image[a], image[b], image[c]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        left, right = _span(cells[a, 0], cells[b, 0], cells[c, 0], width)
        top, bottom = _span(cells[a, 1], cells[b, 1], cells[c, 1], height)
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


@numba.njit(cache=True)
def _span(one, two, three, count):  # type: ignore[no-untyped-def]
    """Return the first and the last of `count` cells that a face touches along an axis; none if it is behind."""
    least, most = min(one, two, three), max(one, two, three)
    return (max(least, 0), min(most, count - 1)) if most < BEHIND else (0, -1)
