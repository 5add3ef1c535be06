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
from mocapflow_draping.parts import PITCH

GUARD = 0.4  # voxels: so much too far can a field read near a sharp edge
DEEP = 5e-5  # m, deeper than this a tail turns back
BACKS = 64  # turns back of one strand, so that one that begins inside the body comes to an end
TOUCH = 3e-4  # m, nearer than this to the contact distance counts as touching


@numba.njit(cache=True, error_model="numpy")
def swing_batch(roots, facing, down, start, skin, links, first, last, parts, values, out, held):  # type: ignore[no-untyped-def]
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
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        out: (B, N, L, 3) m, written.
        held: (B, N, L), written: the part that each particle touches, plus one; 0 where it touches none.
    """
    rows = links.shape[1] + 1
    reach, room, near = np.empty(rows), np.empty(rows), np.zeros(rows, np.int64)
    for b in range(len(roots)):
        for n in range(roots.shape[1]):
            held[b, n] = 0
            _swing(
                roots[b, n], facing[b, n], down[b, n], start[b, n], skin[b], links[n], first[n], last[n],
                parts[b], values, out[b, n], held[b, n], reach, room, near,
            )  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def _swing(root, facing, down, start, skin, links, first, last, parts, values, out, held, reach, room, near):  # type: ignore[no-untyped-def]
    """Drape one strand; `reach` is along the strand, `room` how far each particle may yet move untouched."""
    out[first] = root
    reach[first] = 0.0
    for k in range(first + 1, last + 1):
        reach[k], room[k] = reach[k - 1] + links[k - 1], 0.0
    pivot, angle, turn, backs = first, start, 0.0, 0
    guard = GUARD * parts[0, PITCH]
    while pivot < last:
        x, base = out[pivot], reach[pivot]
        touched = -1
        while touched < 0:
            bx, by, bz = _bar(facing, down, angle)
            turn = angle
            for k in range(pivot + 1, last + 1):  # measure only where the room left could end the turn
                arm = reach[k] - base
                if room[k] - guard < arm * turn:
                    room[k], near[k] = body_distance(
                        x[0] + arm * bx, x[1] + arm * by, x[2] + arm * bz, near[k], parts, values
                    )
                    room[k] -= skin
                    if room[k] < -DEEP and backs < BACKS and angle < math.pi:  # read too far at a sharp edge
                        turn = 2.0 * room[k] / arm
                        backs += 1
                        break
                    if room[k] < TOUCH:
                        touched = k
                        break
                    turn = min(turn, room[k] / arm)
            if touched >= 0 or turn == 0.0:
                break
            angle -= turn
            for k in range(pivot + 1, last + 1):
                room[k] -= (reach[k] - base) * abs(turn)
        bx, by, bz = _bar(facing, down, angle)
        end = touched if touched >= 0 else last
        for k in range(pivot + 1, end + 1):
            arm = reach[k] - base
            out[k, 0], out[k, 1], out[k, 2] = x[0] + arm * bx, x[1] + arm * by, x[2] + arm * bz
        if touched < 0:
            return
        held[touched] = near[touched] + 1
        pivot = touched


@numba.njit(cache=True, error_model="numpy")
def _bar(facing, down, angle):  # type: ignore[no-untyped-def]
    """Return the direction of a tail that stands `angle` out from its `down`."""
    s, c = math.sin(angle), math.cos(angle)
    return s * facing[0] + c * down[0], s * facing[1] + c * down[1], s * facing[2] + c * down[2]
