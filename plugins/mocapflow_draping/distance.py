"""Distance to the posed body at a point: the least over its parts, each read from its voxels (numba)."""

from __future__ import annotations

import math

import numba


@numba.njit(cache=True, inline="always")
def _cell(x, n):  # type: ignore[no-untyped-def]
    """Return the voxel left of x, clamped so that it has a right neighbour."""
    i = int(x)
    return min(max(i, 0), n - 2)


@numba.njit(cache=True)
def part_distance(x, y, z, m, stretch, origin, shape, offset, values, scale):  # type: ignore[no-untyped-def]
    """Return a lower bound of the distance to one part, exact near it; `m` is its rest_from_world (3, 4)."""
    u = (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3] - origin[0]) * scale
    v = (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3] - origin[1]) * scale
    w = (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3] - origin[2]) * scale
    nx, ny, nz = shape[0], shape[1], shape[2]
    cu, cv, cw = min(max(u, 0.0), nx - 1.0), min(max(v, 0.0), ny - 1.0), min(max(w, 0.0), nz - 1.0)
    i, j, k = _cell(cu, nx), _cell(cv, ny), _cell(cw, nz)
    a, b, c = cu - i, cv - j, cw - k
    at = offset + (i * ny + j) * nz + k
    row, plane = nz, ny * nz
    v00 = values[at] * (1.0 - c) + values[at + 1] * c
    v01 = values[at + row] * (1.0 - c) + values[at + row + 1] * c
    v10 = values[at + plane] * (1.0 - c) + values[at + plane + 1] * c
    v11 = values[at + plane + row] * (1.0 - c) + values[at + plane + row + 1] * c
    d = (v00 * (1.0 - b) + v01 * b) * (1.0 - a) + (v10 * (1.0 - b) + v11 * b) * a
    outside = math.sqrt((u - cu) ** 2 + (v - cv) ** 2 + (w - cw) ** 2) / scale
    if outside > 0.0:
        d = max(outside, d - outside)
    return d * stretch


@numba.njit(cache=True)
def body_distance(x, y, z, maps, stretch, centres, radius, origin, shape, offset, values, scale):  # type: ignore[no-untyped-def]
    """Return the least distance over all parts; parts whose ball is farther than the least so far are skipped."""
    least = 1e9
    for p in range(len(radius)):
        dx, dy, dz = x - centres[p, 0], y - centres[p, 1], z - centres[p, 2]
        reach = least + radius[p]
        if reach <= 0.0 or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        d = part_distance(x, y, z, maps[p], stretch[p], origin[p], shape[p], offset[p], values, scale)
        least = min(least, d)
    return least


@numba.njit(cache=True)
def body_distances(points, out, maps, stretch, centres, radius, origin, shape, offset, values, scale):  # type: ignore[no-untyped-def]
    """Write the distances (N,) of points (N, 3) to one posed body."""
    for n in range(len(points)):
        out[n] = body_distance(
            points[n, 0],
            points[n, 1],
            points[n, 2],
            maps,
            stretch,
            centres,
            radius,
            origin,
            shape,
            offset,
            values,
            scale,
        )
