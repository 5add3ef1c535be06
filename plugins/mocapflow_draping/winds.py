"""Winds on fallen strands: the tail that is left turns in the plane of its wind, by the rule of the fall (numba).

Many winds go on from one fall.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance
from mocapflow_draping.swing import swing

SAME = 1.0 - 1e-12  # cosine between directions that are the same


@numba.njit(cache=True, error_model="numpy")
def wind_batch(  # type: ignore[no-untyped-def]
    source, back, towards, amount, skin, links, pivot, last, parts, values, fallen, lying, grid, held
):
    """Turn the hanging tails of D fallen drapes by B winds until they reach a direction or lie.

    Winds of one drape share what is measured where its tails hang, and one that blows as another before it, only
    harder, goes on where that one has left the tail.

    Args:
        source: (B,) drape that each wind turns, the winds of one drape side by side.
        back: (B, N, 3), unit direction perpendicular to `towards`, in the plane of that and straight down.
        towards: (B, N, 3), unit direction in which each tail comes to hang.
        amount: (B, N) rad, between straight down and `towards`.
        skin: (D,) m, contact distance on each body.
        links: (D, N, L - 1) m, lengths of the bars.
        pivot: (D, N) row of the last supported particle.
        last: (N,) row of the last particle.
        parts: (D, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        fallen: (D, N, L, 3) m, `grid` of `fall_batch`.
        lying: (D, N, L), its `held`.
        grid: (B, N, L, 3) m, written.
        held: (B, N, L), written: as `lying`, with what is touched now.

    Source: Rosenhahn 2008, section 12.3
    """
    many, rows = len(source), links.shape[2] + 1  # the last row of what is known of tails: as they hang
    gap, near = np.empty((many + 1, rows)), np.zeros((many + 1, rows), np.int64)
    # as in `fall_batch`: `swing` is compiled for each kind of integer
    fresh, ended = np.ones((many + 1, rows), np.bool_), np.empty(many + 1, np.int32)
    for n in range(len(last)):
        measured = -1
        for b in range(many):
            d, angle = source[b], amount[b, n]
            if angle <= 0.0 or pivot[d, n] == last[n]:
                grid[b, n], held[b, n] = fallen[d, n], lying[d, n]
                continue
            if measured != d:
                _measure(pivot[d, n], last[n], fallen[d, n], skin[d], parts[d], values, gap[many], near[many])
                measured, ended[many] = d, pivot[d, n]
            a = _weaker(b, n, source, towards, amount)
            if a == many:
                grid[b, n], held[b, n] = fallen[d, n], lying[d, n]
            else:
                grid[b, n], held[b, n] = grid[a, n], held[a, n]
                angle -= amount[a, n]
            gap[b], near[b], fresh[b] = gap[a], near[a], fresh[a]
            ended[b] = swing(
                ended[a], back[b, n], towards[b, n], angle, skin[d], links[d, n], last[n], parts[d], values,
                grid[b, n], held[b, n], gap[b], near[b], fresh[b],
            )  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def _weaker(b, n, source, towards, amount):  # type: ignore[no-untyped-def]
    """Return the strongest wind before b that blows as it does but no harder; how many there are if none does."""
    found, most = len(source), 0.0
    for a in range(b):
        if source[a] == source[b] and most < amount[a, n] <= amount[b, n]:
            along = towards[a, n, 0] * towards[b, n, 0] + towards[a, n, 1] * towards[b, n, 1]
            if along > SAME * math.sin(amount[a, n]) * math.sin(amount[b, n]):
                found, most = a, amount[a, n]
    return found


@numba.njit(cache=True, error_model="numpy")
def _measure(pivot, last, strand, skin, parts, values, gap, near):  # type: ignore[no-untyped-def]
    """Write how far each particle of a tail is from contact, and the part that it is nearest to."""
    part = 0
    for k in range(pivot + 1, last + 1):
        p = strand[k]
        distance, part = body_distance(p[0], p[1], p[2], part, parts, values)
        gap[k], near[k] = distance - skin, part
