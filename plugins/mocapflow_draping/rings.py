"""Re-constraining: after the fall, the rings of a garment are brought back to the length of their cloth (numba).

Row by row from the pinned end, so that a row that is feasible stays so: links that are too long pull their ends
together, links that are too short push them apart as far as the ring is stiff, particles inside the body move out,
and every particle keeps the length of its bar to the row above exactly.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_draping.distance import body_distance

UNFOLDED = 0.9  # two links fold no sharper than this share of their length
CLEAR = 2e-4  # m beyond contact to which a particle is pushed, so that it need not be pushed again at once
PUSHES = 5  # out of the body and back to the bar's length, per sweep
PROBE = 1e-3  # m, for the direction out of the body


@numba.njit(cache=True, error_model="numpy")
def close_batch(grid, links, first, last, beside, ring_length, skin, longest, stiff, straight, sweeps, bodies, solid):  # type: ignore[no-untyped-def]
    """Close the rings of B drapes in place.

    Args:
        grid: (B, N, L, 3) m, draped strands; overwritten.
        links: (N, L - 1) m, lengths of the bars.
        first: (N,) row of the first particle of each strand.
        last: (N,) row of the last one.
        beside: (N, L) strand linked on the left-hand side, or -1.
        ring_length: (N, L) m, of that link.
        skin: (B,) m, contact distance.
        longest: largest length of a link over its rest length.
        stiff: 0 to 1, the share of a shortened link's lack that one sweep makes good.
        straight: 0 to 1, the same share for a fold sharper than a right angle: it keeps folds wider than a link.
        sweeps: passes over each row.
        bodies: voxel_from_world (B, P, 3, 4), stretch (B, P) and ball centres (B, P, 3) of the parts.
        solid: radius, shape, offset, values, 1/voxel and margin of the parts.
    """
    maps, stretch, centres = bodies
    strands, rows = grid.shape[1], grid.shape[2]
    bars, seen = np.empty((strands, rows, 3)), np.empty((strands, 3))
    room, near = np.empty(strands), np.zeros(strands, np.int64)
    for b in range(len(grid)):
        _bars(grid[b], links, first, last, bars)
        for row in range(1, rows):
            _place(grid[b], bars, links, first, last, row)
            room[:] = -1.0
            for sweep in range(sweeps):
                backwards = sweep % 2 == 1
                _pull(grid[b], first, last, beside, ring_length, row, longest, stiff, backwards)
                if straight > 0.0:
                    _unfold(grid[b], first, last, beside, ring_length, row, straight, backwards)
                for n in range(strands):
                    if first[n] < row <= last[n]:
                        p, above, link = grid[b, n, row], grid[b, n, row - 1], links[n, row - 1]
                        _to_length(p, above, link)
                        room[n], near[n] = _push_out(
                            p, above, link, skin[b], seen[n], room[n], near[n], maps[b], stretch[b], centres[b], solid
                        )


@numba.njit(cache=True, error_model="numpy")
def _bars(grid, links, first, last, bars):  # type: ignore[no-untyped-def]
    for n in range(grid.shape[0]):
        for row in range(first[n] + 1, last[n] + 1):
            for a in range(3):
                bars[n, row, a] = (grid[n, row, a] - grid[n, row - 1, a]) / links[n, row - 1]


@numba.njit(cache=True, error_model="numpy")
def _place(grid, bars, links, first, last, row):  # type: ignore[no-untyped-def]
    for n in range(grid.shape[0]):
        if first[n] < row <= last[n]:
            for a in range(3):
                grid[n, row, a] = grid[n, row - 1, a] + links[n, row - 1] * bars[n, row, a]


@numba.njit(cache=True, error_model="numpy")
def _pull(grid, first, last, beside, ring_length, row, longest, stiff, backwards):  # type: ignore[no-untyped-def]
    strands = grid.shape[0]
    for step in range(strands):
        n = strands - 1 - step if backwards else step
        m = beside[n, row]
        if m < 0 or row > last[n]:
            continue
        p, q = grid[n, row], grid[m, row]
        dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        rest = ring_length[n, row]
        if length > longest * rest:
            share = (length - longest * rest) / length
        elif length < rest and length > 0.0:
            share = stiff * (length - rest) / length
        else:
            continue
        _draw(p, q, share, row > first[n], row > first[m])


@numba.njit(cache=True, error_model="numpy")
def _unfold(grid, first, last, beside, ring_length, row, straight, backwards):  # type: ignore[no-untyped-def]
    """Push the outer ends of two links that fold sharply apart."""
    strands = grid.shape[0]
    for step in range(strands):
        n = strands - 1 - step if backwards else step
        middle = beside[n, row]
        m = beside[middle, row] if middle >= 0 else -1
        if m < 0 or row > last[n]:
            continue
        p, q = grid[n, row], grid[m, row]
        dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        least = UNFOLDED * (ring_length[n, row] + ring_length[middle, row])
        if 0.0 < length < least:
            _draw(p, q, straight * (length - least) / length, row > first[n], row > first[m])


@numba.njit(cache=True, error_model="numpy")
def _draw(p, q, share, p_moves, q_moves):  # type: ignore[no-untyped-def]
    """Shorten the way from p to q by a share of it; what is pinned stays."""
    if p_moves and q_moves:
        share *= 0.5
    dx, dy, dz = share * (q[0] - p[0]), share * (q[1] - p[1]), share * (q[2] - p[2])
    if p_moves:
        p[0] += dx
        p[1] += dy
        p[2] += dz
    if q_moves:
        q[0] -= dx
        q[1] -= dy
        q[2] -= dz


@numba.njit(cache=True, error_model="numpy")
def _push_out(p, above, link, skin, seen, room, near, maps, stretch, centres, solid):  # type: ignore[no-untyped-def]
    """Move a particle that may be inside the body out of it, at the length of its bar.

    `room` is how far it was from contact where it was `seen` last: until it has moved that far nothing is measured.
    """
    for _ in range(PUSHES):
        if room >= 0.0:
            moved = (p[0] - seen[0]) ** 2 + (p[1] - seen[1]) ** 2 + (p[2] - seen[2]) ** 2
            if moved <= room * room:
                return room, near
        room, near = body_distance(p[0], p[1], p[2], maps, stretch, centres, solid, near)
        room -= skin
        seen[0], seen[1], seen[2] = p[0], p[1], p[2]
        if room >= 0.0:
            return room, near
        gx, gy, gz = _outwards(p, maps, stretch, centres, solid, near)
        depth = CLEAR - room
        p[0] += depth * gx
        p[1] += depth * gy
        p[2] += depth * gz
        _to_length(p, above, link)
    return -1.0, near


@numba.njit(cache=True, error_model="numpy")
def _outwards(p, maps, stretch, centres, solid, near):  # type: ignore[no-untyped-def]
    """Return the unit direction out of the body at a point."""
    gx = body_distance(p[0] + PROBE, p[1], p[2], maps, stretch, centres, solid, near)[0]
    gx -= body_distance(p[0] - PROBE, p[1], p[2], maps, stretch, centres, solid, near)[0]
    gy = body_distance(p[0], p[1] + PROBE, p[2], maps, stretch, centres, solid, near)[0]
    gy -= body_distance(p[0], p[1] - PROBE, p[2], maps, stretch, centres, solid, near)[0]
    gz = body_distance(p[0], p[1], p[2] + PROBE, maps, stretch, centres, solid, near)[0]
    gz -= body_distance(p[0], p[1], p[2] - PROBE, maps, stretch, centres, solid, near)[0]
    g = math.sqrt(gx * gx + gy * gy + gz * gz) + 1e-12
    return gx / g, gy / g, gz / g


@numba.njit(cache=True, error_model="numpy")
def _to_length(p, above, link):  # type: ignore[no-untyped-def]
    dx, dy, dz = p[0] - above[0], p[1] - above[1], p[2] - above[2]
    scale = link / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
    p[0], p[1], p[2] = above[0] + scale * dx, above[1] + scale * dy, above[2] + scale * dz
