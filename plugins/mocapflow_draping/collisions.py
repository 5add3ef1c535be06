"""Collisions resolved: particles inside the body, and links whose middle a limb has come through, move out (numba).

`probe` (N, 3) m is where each strand was measured last and `gap` (N,) m how far from contact it was there, below
zero where it was inside: nearer to it nothing is measured anew. What is called for every particle is inlined:
handing an array on counts its owners, atomically, which costs as much as a voxel read.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance, outwards
from mocapflow_draping.drape_rates import add_rates, contact_lag, length_rates

CLEAR = 2e-4  # m beyond contact to which a particle is pushed, so that it need not be pushed again at once
LIES = 0.003  # m, so near to contact a particle lies on the body
LEVEL = 0.7  # of its normal that points up where the body holds it as well as a floor
PUSHES = 5  # out of the body and back to the bar's length
ROOT_PUSHES = 40  # of a pinned particle, out of one part of the body and then another
TURNS = 12  # of a bar that pushing did not free, towards straight out of the body


@numba.njit(cache=True, error_model="numpy")
def free_roots(grid, first, last, parts, values, motion):  # type: ignore[no-untyped-def]
    """Move strands (B, N, L, 3) whose pinned particle is inside the body out of it, in place, as they are.

    A seam is pinned to skin that another limb may press into: a crotch between thighs.

    Args:
        grid: m; overwritten.
        first: (N,) row of the pinned particle of each strand.
        last: (N,) row of the last one.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        motion: None or, for one body, the `Motion` that is brought along.
    """
    for b in range(grid.shape[0]):
        for n in range(grid.shape[1]):
            for _ in range(ROOT_PUSHES):
                x, y, z = grid[b, n, first[n], 0], grid[b, n, first[n], 1], grid[b, n, first[n], 2]
                d, part = body_distance(x, y, z, 0, parts[b], values)
                if d >= 0.0:
                    break
                out = outwards(x, y, z, part, parts[b], values)
                if motion is not None:
                    rate, part_rate = motion.rate[n, first[n]], motion.part_rate[part]
                    amount = contact_lag(out, (x, y, z), rate, part_rate, 0.0 * motion.skin_rate)
                for row in range(first[n], last[n] + 1):
                    move(grid[b], n, row, CLEAR - d, out)
                    if motion is not None:
                        add_rates(motion.rate, n, row, amount, out)


@numba.njit(cache=True, error_model="numpy")
def free_strands(grid, links, first, last, skin, parts, values):  # type: ignore[no-untyped-def]
    """Move particles of strands (B, N, L, 3) that are inside the body out of it, in place; bars keep their lengths.

    Args:
        grid: m; overwritten.
        links: (B, N, L - 1) m, lengths of the bars.
        first: (N,) row of the pinned particle of each strand.
        last: (N,) row of the last one.
        skin: (B,) m, contact distance.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
    """
    bodies, strands = grid.shape[:2]
    for b in range(bodies):
        probe, gap, near = grid[b, :, 0].copy(), np.full(strands, -1.0), np.zeros(strands, np.int64)
        for n in range(strands):
            before = grid[b, n].copy()
            for row in range(first[n] + 1, last[n] + 1):
                grid[b, n, row] = grid[b, n, row - 1] + before[row] - before[row - 1]
                push_out(grid[b], n, row, links[b, n, row - 1], skin[b], probe, gap, near, parts[b], values, None)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def push_out(grid, n, row, link, skin, probe, gap, near, parts, values, motion):  # type: ignore[no-untyped-def]
    """Move a particle that may be inside the body out of it, at the length of its bar."""
    for _ in range(PUSHES):
        if within(place(grid, n, row), n, probe, gap):
            return
        _measure(grid, n, row, skin, probe, gap, near, parts, values)
        if gap[n] >= 0.0:
            return
        p = place(grid, n, row)
        out = outwards(p[0], p[1], p[2], near[n], parts, values)
        if motion is not None:
            amount = contact_lag(out, p, motion.rate[n, row], motion.part_rate[near[n]], motion.skin_rate)
            add_rates(motion.rate, n, row, amount, out)
        move(grid, n, row, CLEAR - gap[n], out)
        to_length(grid, n, row, link, motion)
    _stand_off(grid, n, row, link, skin, probe, gap, near, parts, values, motion)


@numba.njit(cache=True, error_model="numpy")
def _stand_off(grid, n, row, link, skin, probe, gap, near, parts, values, motion):  # type: ignore[no-untyped-def]
    """Turn a bar that pushing did not free towards straight out of the body above, until it is free."""
    x, y, z = place(grid, n, row - 1)
    part = body_distance(x, y, z, near[n], parts, values)[1]
    gx, gy, gz = outwards(x, y, z, part, parts, values)
    px, py, pz = place(grid, n, row)
    ux, uy, uz = (px - x) / link, (py - y) / link, (pz - z) / link
    for turn in range(TURNS + 1):
        w = turn / TURNS
        grid[n, row, 0] = x + link * ((1.0 - w) * ux + w * gx)
        grid[n, row, 1] = y + link * ((1.0 - w) * uy + w * gy)
        grid[n, row, 2] = z + link * ((1.0 - w) * uz + w * gz)
        to_length(grid, n, row, link, motion)  # its own turn is not followed: it ends where the skin lets it
        _measure(grid, n, row, skin, probe, gap, near, parts, values)
        if gap[n] >= 0.0:
            return


@numba.njit(cache=True, error_model="numpy")
def lift(grid, first, last, left, row, probe, gap, near, mid_probe, mid_gap, parts, values, motion):  # type: ignore[no-untyped-def]
    """Move both ends of a link out of the body where its middle is inside: no limb shall come between them.

    `mid_probe` (N, 3) m is where each middle was measured last, `mid_gap` (N,) m how far from the body it was there.
    """
    for n in range(grid.shape[0]):
        m = left[n, row]
        if m < 0 or row > last[n] or (row <= first[n] and row <= first[m]):
            continue
        px, py, pz = place(grid, n, row)
        qx, qy, qz = place(grid, m, row)
        middle = 0.5 * (px + qx), 0.5 * (py + qy), 0.5 * (pz + qz)
        if within(middle, n, mid_probe, mid_gap) or within(middle, n, probe, gap) or within(middle, m, probe, gap):
            continue
        d, part = body_distance(middle[0], middle[1], middle[2], near[n], parts, values)
        mid_gap[n], mid_probe[n, 0], mid_probe[n, 1], mid_probe[n, 2] = d, middle[0], middle[1], middle[2]
        if d < 0.0:
            out = outwards(middle[0], middle[1], middle[2], part, parts, values)
            if motion is not None:
                between_them = 0.5 * (motion.rate[n, row] + motion.rate[m, row])
                amount = contact_lag(out, middle, between_them, motion.part_rate[part], 0.0 * motion.skin_rate)
                if row > first[n]:
                    add_rates(motion.rate, n, row, amount, out)
                if row > first[m]:
                    add_rates(motion.rate, m, row, amount, out)
            if row > first[n]:
                move(grid, n, row, CLEAR - d, out)
            if row > first[m]:
                move(grid, m, row, CLEAR - d, out)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def supported(grid, n, row, gap, near, parts, values):  # type: ignore[no-untyped-def]
    """Return how well (0 to 1) the body under a particle keeps it from falling."""
    if gap[n] >= LIES:
        return 0.0
    p = place(grid, n, row)
    return min(max(outwards(p[0], p[1], p[2], near[n], parts, values)[2] / LEVEL, 0.0), 1.0)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def to_length(grid, n, row, link, motion):  # type: ignore[no-untyped-def]
    """Put the lower end of a bar at its length from the upper one."""
    x, y, z = place(grid, n, row - 1)
    dx, dy, dz = grid[n, row, 0] - x, grid[n, row, 1] - y, grid[n, row, 2] - z
    if motion is not None:
        length_rates(motion.rate, n, row, (dx, dy, dz), link, motion.stretch_rate)
    scale = link / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
    grid[n, row, 0], grid[n, row, 1], grid[n, row, 2] = x + scale * dx, y + scale * dy, z + scale * dz


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def place(grid, n, row):  # type: ignore[no-untyped-def]
    """Return where a particle is."""
    return grid[n, row, 0], grid[n, row, 1], grid[n, row, 2]


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def move(grid, n, row, amount, towards):  # type: ignore[no-untyped-def]
    """Move a particle by an amount along a direction."""
    grid[n, row, 0] += amount * towards[0]
    grid[n, row, 1] += amount * towards[1]
    grid[n, row, 2] += amount * towards[2]


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def square(p, n, probe):  # type: ignore[no-untyped-def]
    """Return the squared distance of a point from where strand n was measured."""
    dx, dy, dz = p[0] - probe[n, 0], p[1] - probe[n, 1], p[2] - probe[n, 2]
    return dx * dx + dy * dy + dz * dz


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def within(p, n, probe, gap):  # type: ignore[no-untyped-def]
    """Return whether a point is surely clear: no farther from where strand n was measured than its gap there."""
    return gap[n] >= 0.0 and gap[n] * gap[n] >= square(p, n, probe)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _measure(grid, n, row, skin, probe, gap, near, parts, values):  # type: ignore[no-untyped-def]
    x, y, z = place(grid, n, row)
    d, near[n] = body_distance(x, y, z, near[n], parts, values)
    gap[n], probe[n, 0], probe[n, 1], probe[n, 2] = d - skin, x, y, z
