"""Rates of a drape: how its particles move through each step of draping, contacts held as they are (numba).

Rates are per column of unknowns, (..., 3, S), columns side by side for the processor's wide registers. A particle that
touches a part of the body goes along its normal as that part does, and is free to slide.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F64
from mocapflow_draping.distance import outwards

FASTEST = 2.0  # m per rad, or per m of thickness: more than a reach; a ring about to buckle would move without bounds
GRAZING = 0.2  # least slope at which a bar is said to meet the skin: below, its turn would be without bounds


class Motion(NamedTuple):
    """The rates that are brought along, in place, while the rings of one drape are closed."""

    rate: F64  # (N, L, 3, S) of the particles
    bar_rate: F64  # (N, L, 3, S) room for those of the bars, in lengths of theirs
    part_rate: F64  # (P, 3, 4, S) of the points of the body's parts, affine in their place in the world
    skin_rate: F64  # (S,) of the contact distance
    stretch_rate: F64  # (S,) of the logarithm of the bars' length


@numba.njit(cache=True, error_model="numpy")
def swing_rates(  # type: ignore[no-untyped-def]
    grid, held, facing, down, roots, facing_rate, down_rate, links, first, last, parts, values, part_rate, skin_rate,
    stretch_rate, rate,
):  # fmt: skip
    """Write the rates of strands as they fell on one body.

    Args:
        grid: (N, L, 3) m, draped strands.
        held: (N, L) part that a particle touches, plus one; 0 where it hangs free.
        facing: (N, 3) unit directions in which strands stand out.
        down: (N, 3) unit directions in which they come to hang.
        roots: (N, 3, S) rates of the pinned particles.
        facing_rate: (N, 3, S).
        down_rate: (N, 3, S).
        links: (N, L - 1) m, lengths of the bars.
        first: (N,) row of the first particle of each strand.
        last: (N,) row of the last one.
        parts: (P, COLUMNS), the body, see `parts`.
        values: its voxels.
        part_rate: (P, 3, 4, S) rates of a part's points, affine in their place in the world.
        skin_rate: (S,) rate of the contact distance.
        stretch_rate: (S,) rate of the logarithm of the bars' length.
        rate: (N, L, 3, S), written.
    """
    bar, reached = np.empty((2, *rate.shape[2:]))
    for n in range(len(grid)):
        pivot = first[n]
        rate[n, pivot] = roots[n]
        while pivot < last[n]:
            end, arm = pivot + 1, links[n, pivot]
            while end < last[n] and held[n, end] == 0:
                arm += links[n, end]
                end += 1
            x, p = grid[n, pivot], grid[n, end]
            ux, uy, uz = (p[0] - x[0]) / arm, (p[1] - x[1]) / arm, (p[2] - x[2]) / arm
            f, d = facing[n], down[n]
            sine, cosine = ux * f[0] + uy * f[1] + uz * f[2], ux * d[0] + uy * d[1] + uz * d[2]
            for a, u in enumerate((ux, uy, uz)):
                for s in range(len(stretch_rate)):
                    bar[a, s] = sine * facing_rate[n, a, s] + cosine * down_rate[n, a, s] + u * stretch_rate[s]
                    reached[a, s] = rate[n, pivot, a, s] + arm * bar[a, s]
            if held[n, end] > 0:
                part = held[n, end] - 1
                g = outwards(p[0], p[1], p[2], part, parts, values)
                tx, ty, tz = cosine * f[0] - sine * d[0], cosine * f[1] - sine * d[1], cosine * f[2] - sine * d[2]
                slope = arm * max(g[0] * tx + g[1] * ty + g[2] * tz, GRAZING)
                turn = contact_lag(g, p, reached, part_rate[part], skin_rate)
                for a, t in enumerate((tx, ty, tz)):
                    for s in range(len(stretch_rate)):
                        bar[a, s] += turn[s] / slope * t
            away = 0.0
            for k in range(pivot + 1, end + 1):
                away += links[n, k - 1]
                for a in range(3):
                    for s in range(len(stretch_rate)):
                        rate[n, k, a, s] = rate[n, pivot, a, s] + away * bar[a, s]
            pivot = end


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def add_rates(rate, n, row, amount, towards):  # type: ignore[no-untyped-def]
    """Add amounts (S,) along a direction to the rates of a particle."""
    for a in range(3):
        for s in range(len(amount)):
            rate[n, row, a, s] += towards[a] * amount[s]


@numba.njit(cache=True, error_model="numpy")
def contact_lag(normal, p, rate, part_rate, skin_rate):  # type: ignore[no-untyped-def]
    """Return how much faster (S,) a particle at p with rates (3, S) would have to leave the body to stay in contact."""
    gx, gy, gz = normal
    wanted = skin_rate.copy()
    for s in range(len(wanted)):
        vx = part_rate[0, 0, s] * p[0] + part_rate[0, 1, s] * p[1] + part_rate[0, 2, s] * p[2] + part_rate[0, 3, s]
        vy = part_rate[1, 0, s] * p[0] + part_rate[1, 1, s] * p[1] + part_rate[1, 2, s] * p[2] + part_rate[1, 3, s]
        vz = part_rate[2, 0, s] * p[0] + part_rate[2, 1, s] * p[1] + part_rate[2, 2, s] * p[2] + part_rate[2, 3, s]
        wanted[s] += gx * (vx - rate[0, s]) + gy * (vy - rate[1, s]) + gz * (vz - rate[2, s])
    return wanted


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def length_rates(rate, n, row, bar, link, stretch_rate):  # type: ignore[no-untyped-def]
    """Change the rates of a bar's lower end, in `row`, as the bar from the row above is brought to its length."""
    dx, dy, dz = bar
    r = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
    ux, uy, uz, scale, up = dx / r, dy / r, dz / r, link / r, row - 1
    for s in range(rate.shape[3]):
        ax, ay, az = rate[n, up, 0, s], rate[n, up, 1, s], rate[n, up, 2, s]
        ex, ey, ez = rate[n, row, 0, s] - ax, rate[n, row, 1, s] - ay, rate[n, row, 2, s] - az
        along = ux * ex + uy * ey + uz * ez - r * stretch_rate[s]
        mx, my, mz = ax + scale * (ex - along * ux), ay + scale * (ey - along * uy), az + scale * (ez - along * uz)
        share = FASTEST / math.sqrt(max(mx * mx + my * my + mz * mz, FASTEST * FASTEST))
        rate[n, row, 0, s], rate[n, row, 1, s], rate[n, row, 2, s] = share * mx, share * my, share * mz


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def pull_rates(rate, n, m, row, way, share, most, here, there):  # type: ignore[no-untyped-def]
    """Change the rates of two particles that are drawn together by a share of the way between them.

    Args:
        rate: (N, L, 3, S) rates of all particles.
        n: strand of the one.
        m: strand of the other.
        row: of both.
        way: m, three components, from the one to the other, before.
        share: of the way; it grows with the way, up to `most` for an endless one.
        most: see there.
        here: 0 to 1, what the one does of it; 0 if it is pinned.
        there: what the other does.
    """
    dx, dy, dz = way
    growth = (most - share) / (dx * dx + dy * dy + dz * dz)
    for s in range(rate.shape[3]):
        ex = rate[m, row, 0, s] - rate[n, row, 0, s]
        ey = rate[m, row, 1, s] - rate[n, row, 1, s]
        ez = rate[m, row, 2, s] - rate[n, row, 2, s]
        apart = growth * (dx * ex + dy * ey + dz * ez)
        mx, my, mz = share * ex + apart * dx, share * ey + apart * dy, share * ez + apart * dz
        rate[n, row, 0, s] += here * mx
        rate[n, row, 1, s] += here * my
        rate[n, row, 2, s] += here * mz
        rate[m, row, 0, s] -= there * mx
        rate[m, row, 1, s] -= there * my
        rate[m, row, 2, s] -= there * mz
