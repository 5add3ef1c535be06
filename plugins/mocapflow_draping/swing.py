"""The drape itself: strands as chains of bars that swing down about their last support, contact by contact (numba).

A strand stays in one vertical plane and its free tail is a straight ray. So the tail may turn at once by the least
distance over lever arm of its particles: none of them can touch before (method: conservative advancement). Where
a particle touches, it becomes the next support and the rest goes on turning.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance

TOUCH = 2e-4  # m, nearer than this to the contact distance counts as touching


@numba.njit(cache=True)
def swing_batch(roots, facing, down, start, skin, links, first, last, bodies, solid, out, support):  # type: ignore[no-untyped-def]
    """Drape N strands of up to L particles on B posed bodies.

    Args:
        roots: (B, N, 3) m, where each strand is pinned.
        facing: (B, N, 3), unit direction in which each strand stands out, perpendicular to its `down`.
        down: (B, N, 3), unit direction in which each strand comes to hang: gravity, tilted by forces.
        start: (B, N) rad, how far from `down` each strand stands before it falls.
        skin: (B,) m, contact distance.
        links: (N, L - 1) m, lengths of the bars.
        first: (N,) row of the first particle of each strand.
        last: (N,) row of the last one.
        bodies: rest_from_world (B, P, 3, 4), stretch (B, P) and ball centres (B, P, 3) of the parts.
        solid: radius, origin, shape, offset, values and 1/voxel of the parts.
        out: (B, N, L, 3) m, written.
        support: (B, N), written: the last supported particle of each strand.
    """
    maps, stretch, centres = bodies
    reach, room = np.empty(links.shape[1] + 1), np.empty(links.shape[1] + 1)
    for b in range(len(roots)):
        for n in range(roots.shape[1]):
            support[b, n] = _swing(
                roots[b, n], facing[b, n], down[b, n], start[b, n], skin[b], links[n], first[n], last[n],
                maps[b], stretch[b], centres[b], solid, out[b, n], reach, room,
            )  # fmt: skip


@numba.njit(cache=True)
def _swing(root, facing, down, start, skin, links, first, last, maps, stretch, centres, solid, out, reach, room):  # type: ignore[no-untyped-def]
    radius, origin, shape, offset, values, scale = solid
    out[first] = root
    pivot, angle = first, start
    while pivot < last:
        x, y, z = out[pivot, 0], out[pivot, 1], out[pivot, 2]
        arm = 0.0
        for k in range(pivot + 1, last + 1):
            arm += links[k - 1]
            reach[k], room[k] = arm, 0.0
        touched = -1
        while touched < 0:
            bx, by, bz = _bar(facing, down, angle)
            turn = angle
            for k in range(pivot + 1, last + 1):  # measure only where the room left could end the turn
                if room[k] < reach[k] * turn:
                    r = reach[k]
                    room[k] = body_distance(
                        x + r * bx, y + r * by, z + r * bz,
                        maps, stretch, centres, radius, origin, shape, offset, values, scale,
                    ) - skin  # fmt: skip
                    if room[k] < TOUCH:
                        touched = k
                        break
                    turn = min(turn, room[k] / r)
            if touched >= 0 or turn <= 0.0:
                break
            angle -= turn
            for k in range(pivot + 1, last + 1):
                room[k] -= reach[k] * turn
        end = touched if touched >= 0 else last
        bx, by, bz = _bar(facing, down, angle)
        for k in range(pivot + 1, end + 1):
            out[k, 0] = x + reach[k] * bx
            out[k, 1] = y + reach[k] * by
            out[k, 2] = z + reach[k] * bz
        if touched < 0:
            return pivot
        pivot = touched
    return pivot


@numba.njit(cache=True)
def _bar(facing, down, angle):  # type: ignore[no-untyped-def]
    """Return the direction of a tail that stands `angle` out from its `down`."""
    s, c = math.sin(angle), math.cos(angle)
    return s * facing[0] + c * down[0], s * facing[1] + c * down[1], s * facing[2] + c * down[2]
