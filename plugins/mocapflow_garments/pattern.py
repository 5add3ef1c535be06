"""What all garments share: checks of tape measures, parameters, and tubes of strands and rings."""

from __future__ import annotations

import math
import warnings

import numpy as np

from mocapflow.data import Body
from mocapflow.errors import MocapflowError
from mocapflow.records import F64, I32

EASE = 0.002  # m, the least room between waistband and skin
HARMONICS: tuple[tuple[str, ...], ...] = (
    ("flare_rad",),
    ("wind_cos_rad", "wind_sin_rad"),
    ("two_cos_rad", "two_sin_rad"),
)
LARGEST_TILT = math.radians(40)
LARGEST_THICKNESS = 0.010  # m


class GarmentError(MocapflowError):
    """A garment can't be sewn from these measures."""


class GarmentRepaired(UserWarning):
    """A measure was changed so that the garment could be sewn."""


def check_measures(garment: str, measures: dict[str, float]) -> None:
    """Refuse tape measures that are not positive lengths in metres.

    Raises:
        GarmentError: a measure is NaN, infinite, zero, negative, or longer than 4 m.
    """
    for key, value in measures.items():
        if not math.isfinite(value) or value <= 0:
            raise GarmentError(f"{garment}: {key} is {value}", hint="measure it again: a length in metres, above zero")
        if value > 4.0:
            raise GarmentError(
                f"{garment}: {key} is {value} m", hint="measures are in metres; was it meant in cm or mm?"
            )


def repaired(garment: str, what: str) -> None:
    """Record that a measure was changed."""
    warnings.warn(f"{garment}: {what}", GarmentRepaired, stacklevel=3)


def parameters(orders: tuple[int, ...]) -> tuple[tuple[str, ...], F64]:
    """Return names and bounds (Q, 2) of thickness and tail-angle harmonics of the given orders."""
    tilts = [name for order in orders for name in HARMONICS[order]]
    bounds = [[0.0, LARGEST_THICKNESS], *([-LARGEST_TILT, LARGEST_TILT] for _ in tilts)]
    return ("thickness_m", *tilts), np.array(bounds)


def grid_faces(grid: I32, closed: bool = True) -> I32:
    """Return two triangles per cell of a grid (strands, rows) of vertex indices, outward for counter-clockwise."""
    right = np.roll(grid, -1, axis=0) if closed else grid[1:]
    left = grid if closed else grid[:-1]
    a, b, c, d = left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]
    faces: I32 = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, d, b), (b, d, c))])
    return faces


def nearest_skin(body: Body, points: F64) -> I32:
    """Return the body vertex nearest to each point (N, 3)."""
    from scipy.spatial import cKDTree

    nearest: I32 = np.asarray(cKDTree(body.vertices).query(points)[1], np.int32)
    return nearest


def main_joint(body: Body, vertices: I32) -> int:
    """Return the joint that moves most of the given body vertices."""
    weight = np.zeros(len(body.parents))
    np.add.at(weight, body.skin_joint[vertices], body.skin_weight[vertices])
    return int(weight.argmax())
