"""The drape as the chapter prints it: step by step, free ends about their nearest fixed point (numba).

Kept for reproduction and comparison; `swing.py` reaches the taut strand without steps.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance

LOWER = 0.002  # m, how far a cloth that nothing holds sinks at a time
FLOOR = -10.0  # m: what falls past everything stops here
STEP = math.radians(2.0)  # of a wind, so that it blows no tail past what it would touch
HALVINGS = 8  # of a step that would touch, before the tail is left where it is


@numba.njit(cache=True)
def settle_in_steps(grid, fixed, first, last, skin, step, iterations, limited, in_space, parts, values):  # type: ignore[no-untyped-def]
    """Lay B grids of particles on posed bodies, in place.

    What lies between two fixed particles of a strand is taut, and stays.

    Args:
        grid: (B, N, L, 3) m; overwritten.
        fixed: (B, N, L) booleans: pinned particles; those that touch are added.
        first: (N,) row of the first particle of each strand.
        last: (N,) row of the last one.
        skin: (B,) m, contact distance.
        step: rad, how far a particle turns in one iteration.
        iterations: number of turns.
        limited: True: never beyond straight down; False: it swings back in the next turn, as printed.
        in_space: True: the nearest fixed point anywhere; False: along the strand.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.

    Source: Rosenhahn 2008, section 12.3
    """
    for b in range(len(grid)):
        while not fixed[b].any() and grid[b, :, :, 2].max() > FLOOR:
            grid[b, :, :, 2] -= LOWER
            _touch(grid[b], fixed[b], first, last, skin[b], parts[b], values)
        for _ in range(iterations):
            _turn(grid[b], fixed[b], first, last, step, limited, in_space)
            _touch(grid[b], fixed[b], first, last, skin[b], parts[b], values)


@numba.njit(cache=True)
def _touch(grid, fixed, first, last, skin, parts, values):  # type: ignore[no-untyped-def]
    for n in range(grid.shape[0]):
        top, bottom = fixed_span(fixed[n], first[n], last[n])
        for k in range(first[n], last[n] + 1):
            if not top <= k <= bottom:
                p = grid[n, k]
                d = body_distance(p[0], p[1], p[2], 0, parts, values)[0]
                fixed[n, k] = d < skin


@numba.njit(cache=True)
def _turn(grid, fixed, first, last, step, limited, in_space):  # type: ignore[no-untyped-def]
    before = grid.copy()
    for n in range(grid.shape[0]):
        top, bottom = fixed_span(fixed[n], first[n], last[n])
        for k in range(first[n], last[n] + 1):
            if top <= k <= bottom:
                continue  # fixed, or taut between two that are
            m, j = n, min(max(k, top), bottom)
            if in_space:
                m, j = _nearest(before, fixed, before[n, k], first, last)
            if j < 0:
                continue
            x, p = before[m, j], grid[n, k]
            dx, dy, dz = p[0] - x[0], p[1] - x[1], p[2] - x[2]
            flat = math.sqrt(dx * dx + dy * dy)
            if flat < 1e-12:
                continue  # exactly below: no axis
            angle = min(step, math.atan2(flat, -dz)) if limited else step
            s, c = math.sin(angle), math.cos(angle)
            out, up = c * flat + s * dz, c * dz - s * flat
            p[0], p[1], p[2] = x[0] + out * dx / flat, x[1] + out * dy / flat, x[2] + up


@numba.njit(cache=True)
def fixed_span(fixed, first, last):  # type: ignore[no-untyped-def]
    """Return the rows of the first and the last fixed particle of a strand; (last + 1, -1) where there is none."""
    top, bottom = last + 1, -1
    for k in range(first, last + 1):
        if fixed[k]:
            top, bottom = min(top, k), k
    return top, bottom


@numba.njit(cache=True)
def _nearest(grid, fixed, p, first, last):  # type: ignore[no-untyped-def]
    """Return strand and row of the fixed particle nearest to a point, (-1, -1) where there is none."""
    least, m, j = np.inf, -1, -1
    for a in range(grid.shape[0]):
        for r in range(first[a], last[a] + 1):
            if fixed[a, r]:
                q = grid[a, r]
                d = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
                if d < least:
                    least, m, j = d, a, r
    return m, j


@numba.njit(cache=True)
def blow_in_steps(grid, fixed, first, last, skin, force, amount, parts, values):  # type: ignore[no-untyped-def]
    """Turn the free tails of B draped grids towards forces (B, 3) by `amount` (B,) rad, until they touch, in place.

    Returns:
        (B, N) the row of each strand that its tail hangs from.

    Source: Rosenhahn 2008, section 12.3
    """
    trial, held = np.empty((grid.shape[2], 3)), np.empty(fixed.shape[:2], np.int32)
    for b in range(len(grid)):
        for n in range(grid.shape[1]):
            held[b, n] = pivot = max(fixed_span(fixed[b, n], first[n], last[n])[1], first[n])
            if pivot == last[n]:
                continue
            turned = 0.0
            while turned < amount[b] - 1e-12:
                angle = min(STEP, amount[b] - turned)
                for _ in range(HALVINGS):
                    if _blown(grid[b, n], pivot, last[n], force[b], angle, skin[b], parts[b], values, trial):
                        break
                    angle *= 0.5
                else:
                    break
                grid[b, n, pivot + 1 : last[n] + 1] = trial[pivot + 1 : last[n] + 1]
                turned += angle
    return held


@numba.njit(cache=True)
def _blown(strand, pivot, last, force, angle, skin, parts, values, trial):  # type: ignore[no-untyped-def]
    """Write the tail turned towards the force and return True if it stays clear of the body or leaves it."""
    x = strand[pivot]
    d = strand[last] - x
    axis = np.array(
        [d[1] * force[2] - d[2] * force[1], d[2] * force[0] - d[0] * force[2], d[0] * force[1] - d[1] * force[0]]
    )
    length = math.sqrt((axis * axis).sum())
    if length < 1e-12:
        trial[pivot + 1 : last + 1] = strand[pivot + 1 : last + 1]
        return True
    axis /= length
    angle = min(angle, math.atan2(length, (d * force).sum()))
    s, c = math.sin(angle), math.cos(angle)
    for k in range(pivot + 1, last + 1):
        q = strand[k] - x
        along = (axis * q).sum() * (1.0 - c)
        trial[k, 0] = x[0] + c * q[0] + s * (axis[1] * q[2] - axis[2] * q[1]) + along * axis[0]
        trial[k, 1] = x[1] + c * q[1] + s * (axis[2] * q[0] - axis[0] * q[2]) + along * axis[1]
        trial[k, 2] = x[2] + c * q[2] + s * (axis[0] * q[1] - axis[1] * q[0]) + along * axis[2]
        d1 = body_distance(trial[k, 0], trial[k, 1], trial[k, 2], 0, parts, values)[0]
        if d1 < skin:
            p = strand[k]
            if d1 < body_distance(p[0], p[1], p[2], 0, parts, values)[0]:
                return False
    return True
