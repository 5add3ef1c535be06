"""Cloth that hangs from a limb relaxes while its rings close, so that the limb stays inside them (numba).

Fallen by itself, a strand beside a raised thigh hangs straight down, and its ring would be drawn together next to the
leg, or across it. So bars begin near the direction in which the limb carries them and turn down from sweep to sweep.
Rates stay those of the bars as they fell: where nothing holds them, they end there.
"""

from __future__ import annotations

import math

import numba

from mocapflow_draping.collisions import place


@numba.njit(cache=True, error_model="numpy")
def hold(grid, limb, links, first, last, row, most, target, left):  # type: ignore[no-untyped-def]
    """Turn the bars of a row back until they stand `most` rad from the limb; return whether any has to.

    Args:
        grid: (N, L, 3) m, overwritten.
        limb: (N, 3) unit directions in which the limb carries the strands.
        links: (N, L - 1) m, lengths of the bars.
        first: (N,) row down to which each strand stays as it is.
        last: (N,) row of the last particle of each strand.
        row: of the lower ends.
        most: rad.
        target: (N, 3) unit directions in which the bars hung, written.
        left: (N,) rad by which each was turned back, written.
    """
    held = False
    for n in range(len(grid)):
        left[n] = 0.0
        if first[n] < row <= last[n]:
            target[n] = _direction(grid, n, row, links[n, row - 1])
            angle = _angle(target[n], limb[n])
            if angle > most:
                held, left[n] = True, angle - most
                _turn(grid, n, row, links[n, row - 1], target[n], limb[n], angle, left[n])
    return held


@numba.njit(cache=True, error_model="numpy")
def relax(grid, links, row, target, left, turns):  # type: ignore[no-untyped-def]
    """Turn the bars of a row that were held towards their `target` (N, 3), by one of so many turns."""
    for n in range(len(grid)):
        if left[n] > 0.0:
            link = links[n, row - 1]
            now = _direction(grid, n, row, link)
            angle = _angle(now, target[n])
            _turn(grid, n, row, link, now, target[n], angle, min(left[n] / turns, angle))


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _direction(grid, n, row, link):  # type: ignore[no-untyped-def]
    x, y, z = place(grid, n, row - 1)
    return (grid[n, row, 0] - x) / link, (grid[n, row, 1] - y) / link, (grid[n, row, 2] - z) / link


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _angle(u, v):  # type: ignore[no-untyped-def]
    return math.acos(min(max(u[0] * v[0] + u[1] * v[1] + u[2] * v[2], -1.0), 1.0))


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _turn(grid, n, row, link, u, v, angle, by):  # type: ignore[no-untyped-def]
    """Put the lower end of a bar where it points from u towards v, `angle` rad apart, by some rad."""
    sine = math.sin(angle)
    if sine > 1e-6:
        keep, gain = math.sin(angle - by) / sine, math.sin(by) / sine
        for a in range(3):
            grid[n, row, a] = grid[n, row - 1, a] + link * (keep * u[a] + gain * v[a])
