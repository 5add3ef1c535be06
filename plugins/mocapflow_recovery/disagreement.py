"""How far a surface and the trimaps of a frame are apart."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from mocapflow_levelset.crops import around

from mocapflow.data import Surface
from mocapflow.geometry.cameras import projection
from mocapflow.geometry.silhouette_kernels import project
from mocapflow.geometry.silhouettes import covered, distance_to
from mocapflow.records import F32, F64, I32
from mocapflow_recovery.trimaps import Trimap

BEYOND = 1.1  # times the cap, from the person: no nearer by the distance transform, which is a twentieth short
HANGING, FLYING = 1.0, 0.3  # weight of a pixel of cloth: the body holds it where it is, or nothing does


def chamfer_distance(
    surface: Surface, bare: Surface, trimaps: Sequence[Trimap], cap_m: float, cloth_weight: float = HANGING
) -> float:
    """Return the mean over the views of a truncated chamfer distance, in m per unit of the person's area.

    Both ways: the person's pixels by their distance from the model, the model's by theirs from where the person may
    be, each at most `cap_m`. Unlike the area in which they differ it tells a limb that is near from one that is far.

    Args:
        surface: the person, posed and clothed.
        bare: its body alone.
        trimaps: of the views; those that hardly show the person do not count.
        cap_m: beyond, it does not matter how far.
        cloth_weight: of a pixel of cloth: the person's off the model, and the model's where nobody is.
    """
    total, counted = 0.0, [trimap for trimap in trimaps if trimap.informative]
    for trimap in counted:
        cap = cap_m / trimap.pixel_m
        model = covered(surface, trimap.camera)
        skin = model if cloth_weight == HANGING else covered(bare, trimap.camera)
        near = around(trimap.person, round(BEYOND * cap) + 2, 1)
        assert near is not None
        off = distance_to(near.of(model))
        summed = _distance_sum(
            model, skin, off, near.top, near.left, trimap.person, trimap.cloth, trimap.distance, cap, cloth_weight
        )
        total += summed * trimap.pixel_m / np.count_nonzero(trimap.person)
    return total / max(len(counted), 1)


def uncovered_areas(surface: Surface, trimaps: Sequence[Trimap], reaches_m: Sequence[float], cloth_m: float) -> F64:
    """Return the areas (R, 2) m², all views together, of the person farther than each reach off the model: skin, cloth.

    What is within `cloth_m` of the garment counts as neither: cloth swings. Cloth is what shows the garment's colours.
    """
    areas = np.zeros((len(reaches_m), 2))
    for trimap in trimaps:
        off = distance_to(covered(surface, trimap.camera))
        loose = trimap.person & (_from_cloth(surface, trimap) > cloth_m / trimap.pixel_m)
        for row, reach_m in enumerate(reaches_m):
            uncovered = loose & (off > reach_m / trimap.pixel_m)
            worn = np.count_nonzero(uncovered & trimap.cloth)
            areas[row] += np.array([np.count_nonzero(uncovered) - worn, worn]) * trimap.pixel_m**2
    return areas


def floating_area(bare: Surface, trimaps: Sequence[Trimap], reach_m: float) -> float:
    """Return the area (m²) of skin that at least two views show to be in empty space, `reach_m` from the person.

    One view alone may be deceived: by clothes of the colour of the wall behind.
    """
    empty = np.zeros(len(bare.vertices), int)
    for trimap in trimaps:
        rows, column, row = pixels_of(bare.vertices, trimap)
        empty[rows] += trimap.distance[row, column] > reach_m / trimap.pixel_m
    if not (empty >= 2).any():
        return 0.0
    corners = bare.vertices[bare.faces[(empty >= 2)[bare.faces].all(axis=1)]]
    one, other = (corners[:, k] - corners[:, 0] for k in (1, 2))
    return float(np.linalg.norm(np.cross(one, other), axis=1).sum() / 2)


def _from_cloth(surface: Surface, trimap: Trimap) -> F32:
    """Return the distance (h, w) px of every pixel from the garment's vertices; far where there is no garment."""
    cloth = np.zeros(trimap.person.shape, bool)
    _, column, row = pixels_of(surface.vertices[surface.cloth], trimap)
    if not len(row):
        return np.full(cloth.shape, np.inf, np.float32)
    cloth[row, column] = True
    return distance_to(cloth)


def pixels_of(points: F64, trimap: Trimap) -> tuple[I32, I32, I32]:
    """Return which of the points (K, 3) lie in the image, and the column and row of the pixels nearest to them."""
    pixels, depth = np.empty((len(points), 2)), np.empty(len(points))
    project(points, projection(trimap.camera), pixels, depth)
    rows, column, row = _within(pixels, *trimap.person.shape)
    return rows, column, row


@numba.njit(cache=True)
def _within(pixels, height, width):  # type: ignore[no-untyped-def]
    """Return which pixels (K, 2) lie in an image, with their columns and rows, rounded; NaN does not."""
    rows, column, row = np.empty((3, len(pixels)), np.int32)
    count = 0
    for k in range(len(pixels)):
        x, y = np.rint(pixels[k, 0]), np.rint(pixels[k, 1])
        if 0 <= x < width and 0 <= y < height:
            rows[count], column[count], row[count] = k, x, y
            count += 1
    return rows[:count], column[:count], row[:count]


@numba.njit(cache=True)
def _distance_sum(model, skin, off, top, left, person, worn, distance, cap, cloth_weight):  # type: ignore[no-untyped-def]
    """Return the truncated distances of a view, px summed over its pixels: see `chamfer_distance`.

    `off` begins at the row `top` and the column `left`, and holds all of the person.
    """
    total = 0.0
    for y in range(model.shape[0]):
        for x in range(model.shape[1]):
            if person[y, x]:
                total += min(off[y - top, x - left], cap) * (cloth_weight if worn[y, x] else 1.0)
            if model[y, x]:
                total += min(distance[y, x], cap) * (1.0 if skin[y, x] else cloth_weight)
    return total
