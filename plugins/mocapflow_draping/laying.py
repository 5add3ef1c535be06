"""The steps of a drape on batches of posed bodies, and of its rates on one: what the kernels are called with."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, I32, record
from mocapflow_draping.fields import BodyFields
from mocapflow_draping.frames import hanging
from mocapflow_draping.parts import carried_rates, rates
from mocapflow_draping.strands import Strands
from mocapflow_draping.strands import roots as roots_of

Placed = tuple[F64, F64, F64]  # per body and strand: root (B, N, 3) m, directions `facing` and `down` (B, N, 3)


@record
class Rates:
    """How what a drape rests on moves, along S unknowns."""

    steps: F64  # (S,) by which the unknowns were changed
    carry: F64  # (P, 3, 4, S) of the points of the body's parts, affine in their place in the world
    swell: F64  # (S,) of the contact distance


def placed(strands: Strands, chain: F64, out: F64, aside: F64) -> Placed:
    """Return where strands begin and how they stand, at posed joints (B, J, 4, 4) and tilts (B, N) rad."""
    return roots_of(strands, chain), *hanging(strands, chain, out, aside)


def moving(fields: BodyFields, chain: F64, skin: F64, steps: F64) -> Rates:
    """Return how body and contact distance move, from one small step along each unknown and, last, none.

    Args:
        fields: the body's parts.
        chain: (S + 1, J, 4, 4) posed joints.
        skin: (S + 1,) m, contact distance.
        steps: (S,) of the unknowns.
    """
    return Rates(steps=steps, carry=carried_rates(fields, chain, steps), swell=rates(skin, steps))


def fall(strands: Strands, fields: BodyFields, where: Placed, skin: F64, parts: F64, start: float) -> tuple[F64, I32]:
    """Return strands as they fall (B, N, L, 3) m, and what they touch (B, N, L), see `swing_batch`."""
    from mocapflow_draping.swing import swing_batch

    grid = np.empty((len(parts), *strands.vertex.shape, 3))
    held = np.zeros(grid.shape[:3], np.int32)
    standing = np.full(grid.shape[:2], start)
    roots, facing, down = where
    swing_batch(
        roots, facing, down, standing, skin, strands.links, strands.first, strands.last,
        parts, fields.values, grid, held,
    )  # fmt: skip
    return grid, held


def follow(
    strands: Strands, fields: BodyFields, near: Placed, grid: F64, held: I32, parts: F64, moved: Rates
) -> F64:  # fmt: skip
    """Return the rates (N, L, 3, S) of fallen strands (1, N, L, 3) m that begin at the last of `near` (S + 1)."""
    from mocapflow_draping.following import follow_swing

    rate = np.zeros((*grid.shape[1:], len(moved.steps)))
    root_rate, facing_rate, down_rate = (rates(one, moved.steps) for one in near)
    follow_swing(
        grid[0], held[0], near[1][-1], near[2][-1], root_rate, facing_rate, down_rate, strands.links, strands.first,
        strands.last, parts[0], fields.values, moved.carry, moved.swell, rate,
    )  # fmt: skip
    return rate
