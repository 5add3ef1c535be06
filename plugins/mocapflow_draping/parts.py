"""The parts of posed bodies as one table, for kernels: each array handed down costs a call as much as reading a voxel.

A kernel takes a body as `parts` (P, COLUMNS), with the columns named here, and `values`, the voxels of all parts.
"""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64
from mocapflow_draping.fields import MARGIN, BodyFields

MAP = 0  # 12 columns: the rows of voxel_from_world
SIDES = 12  # 3 columns: voxels along each axis
PAD = 15  # voxels: so far inside its grid the part itself begins
OFFSET = 16  # of its first voxel in values
STRETCH = 17  # the least by which the pose stretches the part
PITCH = 18  # m, a voxel's edge in the world, at least
CENTRE = 19  # m, 3 columns: of a ball around the part, in the world
RADIUS = 22  # m, of that ball
COLUMNS = 23


def posed_parts(fields: BodyFields, chain: F64) -> F64:
    """Return the parts (B, P, COLUMNS) of a body at posed joints (B, J, 4, 4)."""
    one, other = chain[:, fields.joints[:, 0]], chain[:, fields.joints[:, 1]]
    posed = 0.5 * (one + other)
    turn = np.einsum("bpij,bpij->bp", one[..., :3, :3], other[..., :3, :3])  # 1 + 2 cos of the angle between the two
    stretch = np.sqrt(0.25 * (turn + 1.0)).clip(1e-3)  # the cosine of half of it: across the axis the mean shrinks
    inverse = np.linalg.inv(posed)[..., :3, :]
    inverse[..., 3] -= fields.origin
    parts = np.empty((*posed.shape[:2], COLUMNS))
    parts[..., MAP:SIDES] = inverse.reshape(*posed.shape[:2], 12) / fields.voxel
    parts[..., SIDES:PAD] = fields.shape
    parts[..., PAD] = MARGIN / fields.voxel
    parts[..., OFFSET] = fields.offset
    parts[..., STRETCH] = stretch
    parts[..., PITCH] = stretch * fields.voxel
    centre = np.einsum("bpij,pj->bpi", posed[..., :3, :3], fields.centre) + posed[..., :3, 3]
    parts[..., CENTRE:RADIUS] = centre
    parts[..., RADIUS] = fields.radius
    return parts


def part_rates(fields: BodyFields, chain: F64, steps: F64) -> F64:
    """Return how the points of each part move: (P, 3, 4, S), affine in their place in the world.

    Args:
        fields: the parts.
        chain: (S + 1, J, 4, 4) posed joints, one small step along each of S unknowns and, last, none.
        steps: (S,) of the unknowns.
    """
    posed = 0.5 * (chain[:, fields.joints[:, 0]] + chain[:, fields.joints[:, 1]])
    return rates((posed @ np.linalg.inv(posed[-1]))[..., :3, :], steps)


def rates(values: F64, steps: F64) -> F64:
    """Return rates (..., S) of values (S + 1, ...), one small step (S,) along each unknown and, last, none."""
    return np.ascontiguousarray(np.moveaxis(values[:-1] - values[-1], 0, -1) / steps)
