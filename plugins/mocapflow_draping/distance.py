"""Distance to the posed body at a point: the least over its parts, each read from its voxels (numba)."""

from __future__ import annotations

import math

import numba

from mocapflow_draping.parts import CENTRE, OFFSET, PAD, PITCH, RADIUS, SIDES, STRETCH


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def part_distance(x, y, z, p, parts, values, least):  # type: ignore[no-untyped-def]
    """Return a lower bound of the distance to part p, exact near it.

    A part whose box is farther than `least` is not read: that bound is returned.
    """
    u, v, w = _voxel(x, y, z, p, parts)
    nx, ny, nz, pad = parts[p, SIDES], parts[p, SIDES + 1], parts[p, SIDES + 2], parts[p, PAD]
    du = max(pad - u, u - (nx - 1.0 - pad), 0.0)
    dv = max(pad - v, v - (ny - 1.0 - pad), 0.0)
    dw = max(pad - w, w - (nz - 1.0 - pad), 0.0)
    box = math.sqrt(du * du + dv * dv + dw * dw) * parts[p, PITCH]
    if u < 0.0 or v < 0.0 or w < 0.0 or u >= nx - 1.0 or v >= ny - 1.0 or w >= nz - 1.0:
        return box
    if box > 0.0 and box >= least:
        return box
    a, b, c = u - math.floor(u), v - math.floor(v), w - math.floor(w)
    v000, v001, v010, v011, v100, v101, v110, v111 = _corners(u, v, w, p, parts, values)
    v00, v01 = v000 + c * (v001 - v000), v010 + c * (v011 - v010)
    v10, v11 = v100 + c * (v101 - v100), v110 + c * (v111 - v110)
    v00 += b * (v01 - v00)
    v10 += b * (v11 - v10)
    return (v00 + a * (v10 - v00)) * parts[p, STRETCH]


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def body_distance(x, y, z, near, parts, values):  # type: ignore[no-untyped-def]
    """Return the least distance over all parts and the part it is to; `near` is the part to try first.

    Parts whose ball is farther than the least so far are skipped.
    """
    least = part_distance(x, y, z, near, parts, values, 1e9)
    nearest = near
    for p in range(len(parts)):
        dx, dy, dz = x - parts[p, CENTRE], y - parts[p, CENTRE + 1], z - parts[p, CENTRE + 2]
        reach = least + parts[p, RADIUS]
        if p == near or reach <= 0.0 or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        d = part_distance(x, y, z, p, parts, values, least)
        if d < least:
            least, nearest = d, p
    return least, nearest


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def outwards(x, y, z, near, parts, values):  # type: ignore[no-untyped-def]
    """Return the unit direction out of the body at a point whose nearest part is `near`: the slope of its field."""
    u, v, w = _voxel(x, y, z, near, parts)
    u = min(max(u, 0.0), parts[near, SIDES] - 1.001)
    v = min(max(v, 0.0), parts[near, SIDES + 1] - 1.001)
    w = min(max(w, 0.0), parts[near, SIDES + 2] - 1.001)
    a, b, c = u - math.floor(u), v - math.floor(v), w - math.floor(w)
    v000, v001, v010, v011, v100, v101, v110, v111 = _corners(u, v, w, near, parts, values)
    v00, v01 = v000 + c * (v001 - v000), v010 + c * (v011 - v010)
    v10, v11 = v100 + c * (v101 - v100), v110 + c * (v111 - v110)
    du = v10 + b * (v11 - v10) - v00 - b * (v01 - v00)
    dv = (v01 - v00) + a * (v11 - v10 - v01 + v00)
    low, high = v001 - v000 + b * (v011 - v010 - v001 + v000), v101 - v100 + b * (v111 - v110 - v101 + v100)
    dw = low + a * (high - low)
    gx = parts[near, 0] * du + parts[near, 4] * dv + parts[near, 8] * dw
    gy = parts[near, 1] * du + parts[near, 5] * dv + parts[near, 9] * dw
    gz = parts[near, 2] * du + parts[near, 6] * dv + parts[near, 10] * dw
    g = math.sqrt(gx * gx + gy * gy + gz * gz) + 1e-12
    return gx / g, gy / g, gz / g


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _voxel(x, y, z, p, parts):  # type: ignore[no-untyped-def]
    """Return where a point of the world lies in the grid of part p."""
    return (
        parts[p, 0] * x + parts[p, 1] * y + parts[p, 2] * z + parts[p, 3],
        parts[p, 4] * x + parts[p, 5] * y + parts[p, 6] * z + parts[p, 7],
        parts[p, 8] * x + parts[p, 9] * y + parts[p, 10] * z + parts[p, 11],
    )


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _corners(u, v, w, p, parts, values):  # type: ignore[no-untyped-def]
    """Return the values at the eight corners of the cell around a place in the grid of part p."""
    ny, nz = int(parts[p, SIDES + 1]), int(parts[p, SIDES + 2])
    one, row, plane = numba.uint64(1), numba.uint64(nz), numba.uint64(ny * nz)  # unsigned: no check for wrap-around
    at = numba.uint64(int(parts[p, OFFSET]) + (int(u) * ny + int(v)) * nz + int(w))
    to = at + plane
    return (
        values[at], values[at + one], values[at + row], values[at + row + one],
        values[to], values[to + one], values[to + row], values[to + row + one],
    )  # fmt: skip
