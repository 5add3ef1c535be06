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
def swing_batch(roots, facing, stop, start, skin, links, counts, bodies, solid, out, support):  # type: ignore[no-untyped-def]
    """Drape N strands of up to L particles on B posed bodies.

    Args:
        roots: (B, N, 3) m, where each strand is pinned.
        facing: (B, N, 2), the horizontal unit direction in which each strand stands before it falls.
        stop: (B, N) rad, the tail angle at which a strand comes to rest: 0 hangs straight down, positive outwards.
        start: rad, the tail angle before the fall.
        skin: (B,) m, contact distance.
        links: (N, L - 1) m, lengths of the bars.
        counts: (N,) number of particles of each strand.
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
                roots[b, n], facing[b, n], stop[b, n], start, skin[b], links[n], counts[n],
                maps[b], stretch[b], centres[b], solid, out[b, n], reach, room,
            )  # fmt: skip


@numba.njit(cache=True)
def _swing(root, facing, stop, start, skin, links, count, maps, stretch, centres, solid, out, reach, room):  # type: ignore[no-untyped-def]
    radius, origin, shape, offset, values, scale = solid
    out[0] = root
    pivot, angle = 0, start
    while pivot < count - 1:
        x, y, z = out[pivot, 0], out[pivot, 1], out[pivot, 2]
        arm = 0.0
        for k in range(pivot + 1, count):
            arm += links[k - 1]
            reach[k], room[k] = arm, 0.0
        touched = -1
        while touched < 0:
            across, down = math.sin(angle), math.cos(angle)
            turn = angle - stop
            for k in range(pivot + 1, count):  # measure only where the room left could end the turn
                if room[k] < reach[k] * turn:
                    r = reach[k]
                    room[k] = body_distance(
                        x + r * across * facing[0], y + r * across * facing[1], z - r * down,
                        maps, stretch, centres, radius, origin, shape, offset, values, scale,
                    ) - skin  # fmt: skip
                    if room[k] < TOUCH:
                        touched = k
                        break
                    turn = min(turn, room[k] / r)
            if touched >= 0 or turn <= 0.0:
                break
            angle -= turn
            for k in range(pivot + 1, count):
                room[k] -= reach[k] * turn
        last = touched if touched >= 0 else count - 1
        across, down = math.sin(angle), math.cos(angle)
        for k in range(pivot + 1, last + 1):
            out[k, 0] = x + reach[k] * across * facing[0]
            out[k, 1] = y + reach[k] * across * facing[1]
            out[k, 2] = z - reach[k] * down
        if touched < 0:
            return pivot
        pivot = touched
    return pivot
