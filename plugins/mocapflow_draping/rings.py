"""Re-constraining: after the fall, the rings of a garment are brought back to the length of their cloth (numba).

Row by row from the pinned end, so that a row that is feasible stays so: particles that have parted farther than the
cloth between them pull together, links that are too short push apart as far as the ring is stiff, particles and
links inside the body move out, and every particle keeps the length of its bar to the row above exactly.

Particles 8, 4 and 2 links apart pull as well: a ring around a raised thigh lacks half its length, and neighbours
alone would hand that on too slowly. What lies on a limb gives way less than what hangs, and what hangs far off the
limb that carries it sinks there little by little: else a raised leg ends up beside its skirt.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.collisions import lift, move, place, push_out, square, supported, to_length
from mocapflow_draping.drape_rates import pull_rates
from mocapflow_draping.relaxation import hold, relax

ENOUGH = 0.03  # of its length: a ring none of whose links is longer by more than that is let be
LEAST = 3  # sweeps, before that
RELAXING = 15  # sweeps in which cloth sinks away from the limb that carries it
STRIDE = 0.02  # m beyond its gap to the body that a particle may go in one sweep, so that it can't end up across a limb


@numba.njit(cache=True, error_model="numpy")
def close_batch(  # type: ignore[no-untyped-def]
    grid, links, first, last, across, length, skin, longest, stiff, bend, limb, hold_rad, slips, sweeps, parts, values,
    motion,
):  # fmt: skip
    """Close the rings of B drapes in place.

    Args:
        grid: (B, N, L, 3) m, draped strands; overwritten.
        links: (B, N, L - 1) m, lengths of the bars.
        first: (B, N) row of each strand down to which it stays as it is: of the pinned particle, or a lower one.
        last: (N,) row of the last particle of each strand.
        across: (K, N, L) strand that lies 1, 2, 4, ... links to the left, or -1.
        length: (K, N, L) m, of the cloth between the two.
        skin: (B,) m, contact distance.
        longest: largest length of a link over its rest length.
        stiff: 0 to 1, the share of a shortened link's lack that one sweep makes good.
        bend: (N, L - 1) 0 to 1, how much each bar keeps the direction of the one above it.
        limb: (B, N, 3) unit direction of each strand if it moved with the limb under it.
        hold_rad: how far from there bars stand at most before they relax; pi: they hang as they fell.
        slips: 0 to 1, how much what lies on top of the body gives way beside what hangs.
        sweeps: passes over each row, at most.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        motion: None or, for one drape, the `Motion` that is brought along.
    """
    for b in range(len(grid)):
        _close(
            grid[b], links[b], first[b], last, across, length, skin[b], longest, stiff, bend, limb[b], hold_rad, slips,
            sweeps, parts[b], values, motion,
        )  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def _close(  # type: ignore[no-untyped-def]
    grid, links, first, last, across, length, skin, longest, stiff, bend, limb, hold_rad, slips, sweeps, parts, values,
    motion,
):  # fmt: skip
    strands, rows = grid.shape[0], grid.shape[1]
    bars, probe = np.empty((strands, rows, 3)), grid[:, 0].copy()
    gap, near = np.full(strands, -1.0), np.zeros(strands, np.int64)
    mid_probe, mid_gap = probe.copy(), np.full(strands, -1.0)
    gives, target, left = np.ones(strands), np.zeros((strands, 3)), np.zeros(strands)
    turns = min(RELAXING, sweeps - LEAST)  # fewer sweeps have no time for it
    may_hold = turns > 0 and hold_rad < math.pi
    _bars(grid, links, first, last, bars)
    if motion is not None:
        _bars(motion.rate, links, first, last, motion.bar_rate)
    for row in range(1, rows):
        _place(grid, bars, links, first, last, row, bend, motion)
        held = may_hold and hold(grid, limb, links, first, last, row, hold_rad, target, left)
        relaxing = turns if held else 0
        gives[:] = 1.0
        for sweep in range(sweeps):
            if 0 < sweep <= relaxing:
                relax(grid, links, row, target, left, turns)
            if sweep > 0 and slips < 1.0:
                _weigh(grid, row, slips, gives, gap, near, parts, values)
            back = sweep % 2 == 1
            for k in range(len(across) - 1, 0, -1):
                _pull(grid, first, last, across[k], length[k], row, longest, 0.0, gives, back, motion)
            excess = _pull(grid, first, last, across[0], length[0], row, longest, stiff, gives, back, motion)
            if sweep > 0:
                lift(grid, first, last, across[0], row, probe, gap, near, mid_probe, mid_gap, parts, values, motion)
            _clear(grid, links, first, last, row, sweep > 0, skin, probe, gap, near, parts, values, motion)
            if sweep + 1 >= LEAST + relaxing and excess < ENOUGH:
                break


@numba.njit(cache=True, error_model="numpy")
def _bars(grid, links, first, last, bars):  # type: ignore[no-untyped-def]
    for n in range(grid.shape[0]):
        for row in range(first[n] + 1, last[n] + 1):
            for a in range(3):
                bars[n, row, a] = (grid[n, row, a] - grid[n, row - 1, a]) / links[n, row - 1]


@numba.njit(cache=True, error_model="numpy")
def _place(grid, bars, links, first, last, row, bend, motion):  # type: ignore[no-untyped-def]
    """Hang a row from the one above it: as it fell, but for the direction it keeps of the bar above."""
    for n in range(grid.shape[0]):
        if first[n] < row <= last[n]:
            link = links[n, row - 1]
            share = bend[n, row - 1] if row - 1 > first[n] else 0.0
            for a in range(3):
                above = grid[n, row - 1, a]
                kept = (above - grid[n, row - 2, a]) / links[n, row - 2] if share > 0.0 else 0.0
                grid[n, row, a] = above + link * (share * kept + (1.0 - share) * bars[n, row, a])
            if motion is not None:
                rate = motion.rate[n]
                turn = (1.0 - share) * motion.bar_rate[n, row]
                if share > 0.0:
                    turn += share / links[n, row - 2] * (rate[row - 1] - rate[row - 2])
                rate[row] = rate[row - 1] + link * turn
            to_length(grid, n, row, link, motion)


@numba.njit(cache=True, error_model="numpy")
def _weigh(grid, row, slips, gives, gap, near, parts, values):  # type: ignore[no-untyped-def]
    """Write how much each particle of a row gives way: as it hangs, or as it lies on the body."""
    for n in range(len(gives)):
        gives[n] = 1.0 - (1.0 - slips) * supported(grid, n, row, gap, near, parts, values)


@numba.njit(cache=True, error_model="numpy")
def _pull(grid, first, last, across, length, row, longest, stiff, gives, backwards, motion):  # type: ignore[no-untyped-def]
    """Draw together what is too far apart; return the largest such excess, as a share of the distance."""
    strands, worst = grid.shape[0], 0.0
    for step in range(strands):
        n = strands - 1 - step if backwards else step
        m = across[n, row]
        if m < 0 or row > last[n]:
            continue
        here, there = (gives[n] if row > first[n] else 0.0), (gives[m] if row > first[m] else 0.0)  # 0: pinned
        dx, dy, dz = (
            grid[m, row, 0] - grid[n, row, 0],
            grid[m, row, 1] - grid[n, row, 1],
            grid[m, row, 2] - grid[n, row, 2],
        )
        way, rest = dx * dx + dy * dy + dz * dz, length[n, row]
        most = longest * rest
        if here + there == 0.0:
            continue
        here, there = here / (here + there), there / (here + there)
        if way > most * most:
            share, limit = 1.0 - most / math.sqrt(way), 1.0
            worst = max(worst, share)
        elif stiff > 0.0 and 0.0 < way < rest * rest:
            share, limit = stiff * (1.0 - rest / math.sqrt(way)), stiff
        else:
            continue
        if motion is not None:
            pull_rates(motion.rate, n, m, row, (dx, dy, dz), share, limit, here, there)
        move(grid, n, row, here * share, (dx, dy, dz))
        move(grid, m, row, -there * share, (dx, dy, dz))
    return worst


@numba.njit(cache=True, error_model="numpy")
def _clear(grid, links, first, last, row, limited, skin, probe, gap, near, parts, values, motion):  # type: ignore[no-untyped-def]
    """Give every bar of a row its length, outside the body."""
    for n in range(grid.shape[0]):
        if first[n] < row <= last[n]:
            most = max(gap[n], 0.0) + STRIDE
            far = square(place(grid, n, row), n, probe)
            if limited and far > most * most:
                share = most / math.sqrt(far)
                for a in range(3):
                    grid[n, row, a] = probe[n, a] + share * (grid[n, row, a] - probe[n, a])
            to_length(grid, n, row, links[n, row - 1], motion)
            push_out(grid, n, row, links[n, row - 1], skin, probe, gap, near, parts, values, motion)
