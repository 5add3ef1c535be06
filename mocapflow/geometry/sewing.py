"""Sewing: how points laid out along strands become a garment that hangs from the skin."""

from __future__ import annotations

import math

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.records import F64, I32

HARMONICS: tuple[tuple[str, ...], ...] = (
    ("flare_rad",),
    ("wind_cos_rad", "wind_sin_rad"),
    ("two_cos_rad", "two_sin_rad"),
    ("three_cos_rad", "three_sin_rad"),
)
THICKNESS = "thickness_m"
TAKE_UP = "take_up"
NO_FORCES = (THICKNESS, TAKE_UP)  # these follow the recording, not the frame
LARGEST_TILT = math.radians(40)
LARGEST_THICKNESS = 0.010  # m
LARGEST_TAKE_UP = 0.15  # share of the length of a strand
NOTICED = 0.001  # m by which a garment is wider than its measure: less is not worth a word

Parameters = tuple[tuple[str, ...], F64]


def force_parameters(orders: tuple[int, ...]) -> Parameters:
    """Return names and bounds (Q, 2) of the cloth's thickness and of its tail-angle harmonics of the given orders.

    Order 0 is a flare, order 1 a wind, order 2 two legs inside one ring, order 3 a ring that one leg
    leaves; drapers know what they mean.
    """
    tilts = [name for order in orders for name in HARMONICS[order]]
    bounds = [[0.0, LARGEST_THICKNESS], *([-LARGEST_TILT, LARGEST_TILT] for _ in tilts)]
    return (THICKNESS, *tilts), np.array(bounds)


def with_take_up(parameters: Parameters) -> Parameters:
    """Return names and bounds with, last, the share of the length of hanging strands that folds and gathers take up."""
    names, bounds = parameters
    return (*names, TAKE_UP), np.concatenate([bounds, [[0.0, LARGEST_TAKE_UP]]])


def sheet(
    name: str,
    body: Body,
    rows: F64,
    *,
    closed: bool,
    around: F64 | None = None,
    carried_by: I32 | None = None,
    parameters: Parameters | None = None,
    repairs: tuple[str, ...] = (),
) -> GarmentMesh:
    """Return the garment of a grid of cloth: strands side by side, each pinned to the skin nearest its first point.

    Args:
        name: of the garment.
        body: the body at rest.
        rows: (N, L, 3) m, N strands of L points from the pinned end, counter-clockwise seen along the strands'
            way back to it (from above, for a skirt): so faces look outwards.
        closed: True for a tube, the last strand beside the first; False for a sheet with two free edges.
        around: (L,) m, wanted length of each row from one end to the other; None: as the points lie.
        carried_by: (L,) joint that moves each row before the drape; None: the one that moves the pinned skin.
        parameters: names and bounds (Q, 2); None: thickness alone.
        repairs: tape measures that were changed so that it could be sewn, see `widened`.
    """
    count, length = rows.shape[:2]
    grid = np.arange(count * length, dtype=np.int32).reshape(count, length)
    vertices = rows.reshape(-1, 3)
    pinned_to = nearest_skin(body, rows[:, 0])
    moved_by = np.full(length, carrier(body, pinned_to), np.int32) if carried_by is None else carried_by
    left, right = (grid, np.roll(grid, -1, axis=0)) if closed else (grid[:-1], grid[1:])
    rings = np.stack([left.T, right.T], axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(vertices[rings[:, 0]] - vertices[rings[:, 1]], axis=1)
    names, bounds = parameters or force_parameters(())
    return GarmentMesh(
        name=name,
        vertices=vertices,
        faces=grid_faces(grid, closed),
        strands=grid,
        rings=rings,
        ring_length=apart if around is None else np.repeat(around / len(left), len(left)),
        carried_by=np.tile(moved_by, count).astype(np.int32),
        pinned=grid[:, 0].copy(),
        pinned_to=pinned_to,
        parameter_names=names,
        parameter_bounds=bounds,
        repairs=repairs,
    )


def widened(**measures: tuple[float, float]) -> tuple[str, ...]:
    """Return what to record of tape measures, wanted and sewn (m), that are too tight for the body under them."""
    return tuple(
        f"{name} {wanted:.3f} is tighter than the body; widened to {sewn:.3f}"
        for name, (wanted, sewn) in measures.items()
        if sewn > wanted + NOTICED
    )


def grid_faces(grid: I32, closed: bool = True) -> I32:
    """Return triangles (F, 3), two per cell of a grid (strands, rows) of vertices, outward if counter-clockwise."""
    right = np.roll(grid, -1, axis=0) if closed else grid[1:]
    left = grid if closed else grid[:-1]
    a, b, c, d = left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]
    return np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, d, b), (b, d, c))])


def nearest_skin(body: Body, points: F64) -> I32:
    """Return the body vertex nearest to each point (N, 3)."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(body.vertices).query(points)[1], np.int32)


def carrier(body: Body, vertices: I32) -> int:
    """Return the joint that moves most of the given body vertices."""
    weight = np.zeros(len(body.parents))
    np.add.at(weight, body.skin_joint[vertices], body.skin_weight[vertices])
    return int(weight.argmax())
