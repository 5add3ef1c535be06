"""Out of the body: particles at the ends of their bars, and links whose middle a limb has come through (numba).

`seen` (N, 3) m is where each strand was measured last and `room` (N,) m how far from contact it was there, below
zero where it was inside: within that room nothing is measured anew. What is called for every particle is inlined:
handing an array on counts its owners, atomically, which costs as much as a voxel read.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance, outwards
from mocapflow_draping.following import follow_length, follow_move, lack

CLEAR = 2e-4  # m beyond contact to which a particle is pushed, so that it need not be pushed again at once
PUSHES = 5  # out of the body and back to the bar's length
TURNS = 12  # of a bar that pushing did not free, towards straight out of the body


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def push_out(grid, n, row, link, skin, seen, room, near, parts, values, motion):  # type: ignore[no-untyped-def]
    """Move a particle that may be inside the body out of it, at the length of its bar."""
    p, above = grid[n, row], grid[n, row - 1]
    for _ in range(PUSHES):
        if room[n] >= way(p, seen[n]):
            return
        _measure(p, n, skin, seen, room, near, parts, values)
        if room[n] >= 0.0:
            return
        out = outwards(p[0], p[1], p[2], near[n], parts, values)
        if motion is not None:
            rate, _, carry, swell = motion
            follow_move(rate[n, row], lack(out, p, rate[n, row], carry[near[n]], swell), out)
        _move(p, CLEAR - room[n], out)
        if motion is not None:
            follow_length(motion[0][n, row], motion[0][n, row - 1], p, above, link)
        to_length(p, above, link)
    part = body_distance(above[0], above[1], above[2], near[n], parts, values)[1]
    gx, gy, gz = outwards(above[0], above[1], above[2], part, parts, values)
    ux, uy, uz = (p[0] - above[0]) / link, (p[1] - above[1]) / link, (p[2] - above[2]) / link
    for turn in range(TURNS + 1):  # from where it was left to straight away from the skin above
        w = turn / TURNS
        p[0] = above[0] + link * ((1.0 - w) * ux + w * gx)
        p[1] = above[1] + link * ((1.0 - w) * uy + w * gy)
        p[2] = above[2] + link * ((1.0 - w) * uz + w * gz)
        if motion is not None:  # its own turn is not followed: it ends where the skin lets it
            follow_length(motion[0][n, row], motion[0][n, row - 1], p, above, link)
        to_length(p, above, link)
        _measure(p, n, skin, seen, room, near, parts, values)
        if room[n] >= 0.0:
            return


@numba.njit(cache=True, error_model="numpy")
def lift(grid, first, last, beside, row, seen, room, near, between, clear, parts, values, motion):  # type: ignore[no-untyped-def]
    """Move both ends of a link out of the body where its middle is inside: no limb shall come between them.

    `between` (N, 3) m is where each middle was measured last, `clear` (N,) m how far from the body it was there.
    """
    middle = np.empty(3)
    for n in range(grid.shape[0]):
        m = beside[n, row]
        if m < 0 or row > last[n] or (row <= first[n] and row <= first[m]):
            continue
        p, q = grid[n, row], grid[m, row]
        for a in range(3):
            middle[a] = 0.5 * (p[a] + q[a])
        if clear[n] > way(middle, between[n]) or room[n] > way(middle, seen[n]) or room[m] > way(middle, seen[m]):
            continue
        d, part = body_distance(middle[0], middle[1], middle[2], near[n], parts, values)
        clear[n], between[n] = d, middle
        if d < 0.0:
            out = outwards(middle[0], middle[1], middle[2], part, parts, values)
            if motion is not None:
                rate, _, carry, swell = motion
                amount = lack(out, middle, 0.5 * (rate[n, row] + rate[m, row]), carry[part], 0.0 * swell)
                if row > first[n]:
                    follow_move(rate[n, row], amount, out)
                if row > first[m]:
                    follow_move(rate[m, row], amount, out)
            if row > first[n]:
                _move(p, CLEAR - d, out)
            if row > first[m]:
                _move(q, CLEAR - d, out)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def to_length(p, above, link):  # type: ignore[no-untyped-def]
    """Put the lower end of a bar at its length from the upper one."""
    dx, dy, dz = p[0] - above[0], p[1] - above[1], p[2] - above[2]
    scale = link / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
    p[0], p[1], p[2] = above[0] + scale * dx, above[1] + scale * dy, above[2] + scale * dz


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def way(p, q):  # type: ignore[no-untyped-def]
    """Return the distance between two points."""
    return math.sqrt((p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _measure(p, n, skin, seen, room, near, parts, values):  # type: ignore[no-untyped-def]
    d, near[n] = body_distance(p[0], p[1], p[2], near[n], parts, values)
    room[n] = d - skin
    seen[n, 0], seen[n, 1], seen[n, 2] = p[0], p[1], p[2]


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _move(p, amount, towards):  # type: ignore[no-untyped-def]
    p[0], p[1], p[2] = p[0] + amount * towards[0], p[1] + amount * towards[1], p[2] + amount * towards[2]
