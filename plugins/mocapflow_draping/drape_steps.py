"""The steps of a drape on batches of posed bodies, and of its rates on one: what the kernels are called with."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mocapflow.data import PoseBatch
from mocapflow.records import F64, I32, record
from mocapflow_draping.directions import DOWN, standing_out, wind_turns
from mocapflow_draping.fields import BodyFields
from mocapflow_draping.parts import part_rates, rates
from mocapflow_draping.strands import Strands, roots

START = math.radians(95.0)  # from straight down, how far strands stand out before they fall: above level

Winds = tuple[F64, F64]  # rad, per drape and strand: tilts (B, N) of its tail, outwards and to its left


class Starts(NamedTuple):
    """Where N strands begin on each of B bodies, before they fall."""

    root: F64  # (B, N, 3) m
    facing: F64  # (B, N, 3) horizontal unit direction in which each stands out
    links: F64  # (B, N, L - 1) m, lengths of the bars


@record
class BodyRates:
    """How what a drape rests on moves, along S unknowns."""

    steps: F64  # (S,) by which the unknowns were changed
    part_rate: F64  # (P, 3, 4, S) of the points of the body's parts, affine in their place in the world
    skin_rate: F64  # (S,) of the contact distance
    stretch_rate: F64  # (S,) of the logarithm of the bars' length


class Drapes(NamedTuple):
    """B drapes of N strands with L particles."""

    grid: F64  # (B, N, L, 3) m
    held: I32  # (B, N, L) part that a particle touches, plus one; 0 where it touches none
    pivot: I32  # (B, N) row of the last particle on which a strand lay when it had fallen


def distinct(poses: PoseBatch, skin: F64, length: F64) -> tuple[I32, I32]:
    """Return which rows (D,) of a batch are unlike the row before, and the run (B,) that each row belongs to.

    The rows of a run have the same pose, contact distance and length of cloth: strands fall once for all of them.
    """
    known = np.concatenate([poses.root.reshape(len(skin), -1), poses.angles, skin[:, None], length[:, None]], axis=1)
    new = np.append(True, np.any(known[1:] != known[:-1], axis=1))
    return np.flatnonzero(new).astype(np.int32), (np.cumsum(new) - 1).astype(np.int32)


def body_rates(fields: BodyFields, chain: F64, skin: F64, length: F64, steps: F64) -> BodyRates:
    """Return how body, contact distance and cloth move, from one small step along each unknown and, last, none.

    Args:
        fields: the body's parts.
        chain: (S + 1, J, 4, 4) posed joints.
        skin: (S + 1,) m, contact distance.
        length: (S + 1,) of the cloth, over that as sewn.
        steps: (S,) of the unknowns.
    """
    return BodyRates(
        steps=steps,
        part_rate=part_rates(fields, chain, steps),
        skin_rate=rates(skin, steps),
        stretch_rate=rates(np.log(length), steps),
    )


def strand_starts(strands: Strands, chain: F64, links: F64) -> Starts:
    """Return where strands with bars `links` (B, N, L - 1) m begin, at posed joints (B, J, 4, 4)."""
    return Starts(roots(strands, chain), standing_out(strands, chain), links)


def drape_strands(
    strands: Strands, fields: BodyFields, starts: Starts, winds: Winds, source: I32, skin: F64, parts: F64
) -> Drapes:
    """Return B drapes on D bodies: strands fall once on each body, then winds turn the tails that are left.

    Args:
        strands: the garment's strands.
        fields: the body's parts.
        starts: of the strands on each body.
        winds: of each drape.
        source: (B,) body of each drape.
        skin: (D,) m, contact distance.
        parts: (D, P, COLUMNS), the bodies.
    """
    from mocapflow_draping.swing import fall_batch
    from mocapflow_draping.winds import wind_batch

    root, facing, links = (np.ascontiguousarray(each) for each in starts)  # other strides would be compiled again
    shape = strands.vertex.shape
    fallen, lying = np.empty((len(parts), *shape, 3)), np.empty((len(parts), *shape), np.int32)
    fall_batch(
        root, facing, START, skin, links, strands.first, strands.last, parts, fields.values,
        fallen, lying,
    )  # fmt: skip
    pivot = np.where(lying > 0, np.arange(shape[1], dtype=np.int32), strands.first[:, None]).max(axis=2)
    grid, held = np.empty((len(source), *shape, 3)), np.empty((len(source), *shape), np.int32)
    back, towards, amount = wind_turns(facing[source], *winds)
    wind_batch(
        source, back, towards, amount, skin, links, pivot, strands.last, parts, fields.values,
        fallen, lying, grid, held,
    )  # fmt: skip
    return Drapes(grid, held, pivot[source])


def drape_with_rates(
    strands: Strands, fields: BodyFields, near: Starts, winds: Winds, skin: F64, parts: F64, moved: BodyRates
) -> tuple[F64, F64]:
    """Return one drape (1, N, L, 3) m, and its rates (N, L, 3, S).

    Args:
        strands: the garment's strands.
        fields: the body's parts.
        near: of S + 1 bodies, one small step along each unknown and, last, none.
        winds: of each of them.
        skin: (1,) m, contact distance on the last.
        parts: (1, P, COLUMNS), the last body.
        moved: how it moves.
    """
    here, still = Starts(*(each[-1:] for each in near)), (winds[0][-1:], winds[1][-1:])
    draped = drape_strands(strands, fields, here, still, np.zeros(1, np.int32), skin, parts)
    return draped.grid, _strand_rates(strands, fields, near, winds, draped, parts, moved)


def _strand_rates(
    strands: Strands, fields: BodyFields, near: Starts, winds: Winds, draped: Drapes, parts: F64, moved: BodyRates
) -> F64:
    """Return the rates (N, L, 3, S) of one drape; see `drape_with_rates`."""
    from mocapflow_draping.drape_rates import swing_rates

    rate = np.zeros((*draped.grid.shape[1:], len(moved.steps)))
    (root, facing, links), (back, towards, _) = near, wind_turns(near.facing, *winds)
    begin, down = rates(root, moved.steps), np.broadcast_to(DOWN, facing.shape)
    for first, out, to in ((strands.first, facing, down), (draped.pivot[0], back, towards)):
        # other strides, or rows that can't be written, would be compiled again
        here, there = (np.ascontiguousarray(way[-1]) for way in (out, to))
        swing_rates(
            draped.grid[0], draped.held[0], here, there, begin, rates(out, moved.steps),
            rates(to, moved.steps), links[-1], first.copy(), strands.last, parts[0], fields.values, moved.part_rate,
            moved.skin_rate, moved.stretch_rate, rate,
        )  # fmt: skip
        begin = rate[np.arange(len(rate)), draped.pivot[0]]
    return rate
