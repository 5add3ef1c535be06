"""Distance to the posed body at a point: the least over its parts, each read from its voxels (numba)."""

from __future__ import annotations

import math

import numba


@numba.njit(cache=True, error_model="numpy")
def part_distance(x, y, z, p, maps, stretch, solid, least):  # type: ignore[no-untyped-def]
    """Return a lower bound of the distance to part p, exact near it; `maps` lead from the world to its voxels.

    A part whose box is farther than `least` is not read: that bound is returned.
    """
    _, shape, offset, values, scale, margin = solid
    u = maps[p, 0, 0] * x + maps[p, 0, 1] * y + maps[p, 0, 2] * z + maps[p, 0, 3]
    v = maps[p, 1, 0] * x + maps[p, 1, 1] * y + maps[p, 1, 2] * z + maps[p, 1, 3]
    w = maps[p, 2, 0] * x + maps[p, 2, 1] * y + maps[p, 2, 2] * z + maps[p, 2, 3]
    nx, ny, nz = shape[p, 0], shape[p, 1], shape[p, 2]
    pad = margin * scale  # the part itself begins this many voxels inside its grid
    du = max(pad - u, u - (nx - 1 - pad), 0.0)
    dv = max(pad - v, v - (ny - 1 - pad), 0.0)
    dw = max(pad - w, w - (nz - 1 - pad), 0.0)
    box = math.sqrt(du * du + dv * dv + dw * dw) * stretch[p] / scale
    if u < 0.0 or v < 0.0 or w < 0.0 or u >= nx - 1 or v >= ny - 1 or w >= nz - 1 or (box > 0.0 and box >= least):
        return box
    i, j, k = int(u), int(v), int(w)
    a, b, c = u - i, v - j, w - k
    one, row, plane = numba.uint64(1), numba.uint64(nz), numba.uint64(ny * nz)  # unsigned: no check for wrap-around
    at = numba.uint64(offset[p] + (i * ny + j) * nz + k)
    to = at + plane
    v00 = values[at] + c * (values[at + one] - values[at])
    v01 = values[at + row] + c * (values[at + row + one] - values[at + row])
    v10 = values[to] + c * (values[to + one] - values[to])
    v11 = values[to + row] + c * (values[to + row + one] - values[to + row])
    v00 += b * (v01 - v00)
    v10 += b * (v11 - v10)
    return (v00 + a * (v10 - v00)) * stretch[p]


@numba.njit(cache=True, error_model="numpy")
def body_distance(x, y, z, maps, stretch, centres, solid, near):  # type: ignore[no-untyped-def]
    """Return the least distance over all parts and the part it is to; `near` is the part to try first.

    Parts whose ball is farther than the least so far are skipped.
    """
    radius = solid[0]
    least = part_distance(x, y, z, near, maps, stretch, solid, 1e9)
    nearest = near
    for p in range(len(radius)):
        dx, dy, dz = x - centres[p, 0], y - centres[p, 1], z - centres[p, 2]
        reach = least + radius[p]
        if p == near or reach <= 0.0 or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        d = part_distance(x, y, z, p, maps, stretch, solid, least)
        if d < least:
            least, nearest = d, p
    return least, nearest


@numba.njit(cache=True, error_model="numpy")
def body_distances(points, out, maps, stretch, centres, solid):  # type: ignore[no-untyped-def]
    """Write the distances (N,) of points (N, 3) to one posed body."""
    near = 0
    for n in range(len(points)):
        out[n], near = body_distance(points[n, 0], points[n, 1], points[n, 2], maps, stretch, centres, solid, near)
