"""The drape itself: strands as chains of bars that swing about their last support, contact by contact (numba).

A strand falls in one vertical plane and its free tail is a straight ray. So the tail may turn at once by the least
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
def fall_batch(roots, facing, start, skin, links, first, last, parts, values, grid, held):  # type: ignore[no-untyped-def]
    """Let N strands of up to L particles fall on B posed bodies until they hang straight down or lie.

    Args:
        roots: (B, N, 3) m, where each strand is pinned.
        facing: (B, N, 3), horizontal unit direction in which each strand stands out.
        start: rad, how far from straight down each strand stands before it falls.
        skin: (B,) m, contact distance.
        links: (B, N, L - 1) m, lengths of the bars.
        first: (N,) row of the first particle of each strand.
        last: (N,) row of the last one.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        grid: (B, N, L, 3) m, written.
        held: (B, N, L), written: the part that each particle touches, plus one; 0 where it touches none.
    """
    rows, down = links.shape[2] + 1, np.array([0.0, 0.0, -1.0])
    gap, near, fresh = np.empty(rows), np.zeros(rows, np.int64), np.empty(rows, np.bool_)
    for b in range(len(roots)):
        near[:] = 0  # as if it were the only one: the part that is tried first decides in the last digits
        for n in range(roots.shape[1]):
            held[b, n], grid[b, n, first[n]] = 0, roots[b, n]
            gap[:], fresh[:] = 0.0, False
            swing(
                first[n], facing[b, n], down, start, skin[b], links[b, n], last[n], parts[b], values,
                grid[b, n], held[b, n], gap, near, fresh,
            )  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def swing(pivot, facing, down, angle, skin, links, last, parts, values, out, held, gap, near, fresh):  # type: ignore[no-untyped-def]
    """Turn the tail below `pivot` from `angle` to `down`; return the row of the last supported particle.

    `gap` is how far each particle may yet move untouched, `fresh` where it was measured right here.
    """
    turn, backs = 0.0, 0
    guard = GUARD * parts[0, PITCH]
    while pivot < last:
        x = out[pivot]
        touched = -1
        while touched < 0:
            bx, by, bz = _bar(facing, down, angle)
            turn, arm = angle, 0.0
            for k in range(pivot + 1, last + 1):  # measure only where the gap could end the turn
                arm += links[k - 1]
                if gap[k] - guard < arm * turn:
                    if not fresh[k]:
                        distance, near[k] = body_distance(
                            x[0] + arm * bx, x[1] + arm * by, x[2] + arm * bz, near[k], parts, values
                        )
                        gap[k], fresh[k] = distance - skin, True
                    if gap[k] < -DEEP and backs < BACKS and angle < math.pi:  # read too far at a sharp edge
                        turn = 2.0 * gap[k] / arm
                        backs += 1
                        break
                    if gap[k] < TOUCH:
                        touched = k
                        break
                    turn = min(turn, gap[k] / arm)
            if touched >= 0 or turn == 0.0:
                break
            angle -= turn
            arm = 0.0
            for k in range(pivot + 1, last + 1):
                arm += links[k - 1]
                gap[k] -= arm * abs(turn)
                fresh[k] = False
        bx, by, bz = _bar(facing, down, angle)
        arm = 0.0
        for k in range(pivot + 1, (touched if touched >= 0 else last) + 1):
            arm += links[k - 1]
            out[k, 0], out[k, 1], out[k, 2] = x[0] + arm * bx, x[1] + arm * by, x[2] + arm * bz
        if touched < 0:
            break
        held[touched] = near[touched] + 1
        pivot = touched
    return pivot


@numba.njit(cache=True, error_model="numpy")
def _bar(facing, down, angle):  # type: ignore[no-untyped-def]
    """Return the direction of a tail that stands `angle` out from its `down`."""
    s, c = math.sin(angle), math.cos(angle)
    return s * facing[0] + c * down[0], s * facing[1] + c * down[1], s * facing[2] + c * down[2]
