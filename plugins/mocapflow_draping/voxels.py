"""A signed distance grid of a closed triangle mesh: exact near the surface, and sign by winding number."""

from __future__ import annotations

import math

import numba
import numpy as np
from scipy.ndimage import distance_transform_edt

from mocapflow.records import F64, I32

BAND = 2  # voxels on either side of a triangle's box in which its distance is taken exactly


def signed_distance(
    vertices: F64, faces: I32, origin: F64, shape: tuple[int, int, int], voxel: float
) -> tuple[F64, I32]:
    """Return the signed distance (X, Y, Z) m to a mesh, negative inside, and the nearest face of each voxel.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3), outward by the right hand; small holes are bridged by the winding number.
        origin: (3,) m, centre of voxel (0, 0, 0).
        shape: number of voxels per axis.
        voxel: edge of a voxel in m.
    """
    distance, nearest = np.full(shape, np.inf), np.full(shape, -1, np.int32)
    _near(vertices, faces, origin, voxel, BAND, distance, nearest)
    indices = distance_transform_edt(nearest < 0, return_distances=False, return_indices=True)
    nearest = nearest[tuple(indices)]  # far from the surface: the face that is nearest to the nearest near voxel
    _far(vertices, faces, origin, voxel, distance, nearest)
    for backwards in (False, True):
        _sweep(vertices, faces, origin, voxel, distance, nearest, backwards)
    crossings = np.zeros(shape, np.int32)
    _crossings(vertices, faces, origin, voxel, crossings)
    winding = np.cumsum(crossings[:, :, ::-1], axis=2)[:, :, ::-1]
    return np.where(winding != 0, -distance, distance), nearest


@numba.njit(cache=True)
def _near(vertices, faces, origin, voxel, band, distance, nearest):  # type: ignore[no-untyped-def]
    low, high, point = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3)
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        for k in range(3):
            low[k] = max(0, math.floor((min(a[k], b[k], c[k]) - origin[k]) / voxel) - band)
            high[k] = min(distance.shape[k], math.ceil((max(a[k], b[k], c[k]) - origin[k]) / voxel) + band + 1)
        for i in range(low[0], high[0]):
            point[0] = origin[0] + voxel * i
            for j in range(low[1], high[1]):
                point[1] = origin[1] + voxel * j
                for k in range(low[2], high[2]):
                    point[2] = origin[2] + voxel * k
                    d = to_triangle(point, a, b, c)
                    if d < distance[i, j, k]:
                        distance[i, j, k] = d
                        nearest[i, j, k] = f


@numba.njit(cache=True)
def _far(vertices, faces, origin, voxel, distance, nearest):  # type: ignore[no-untyped-def]
    point = np.empty(3)
    for i in range(distance.shape[0]):
        for j in range(distance.shape[1]):
            for k in range(distance.shape[2]):
                if math.isinf(distance[i, j, k]):
                    point[0], point[1], point[2] = origin[0] + voxel * i, origin[1] + voxel * j, origin[2] + voxel * k
                    f = faces[nearest[i, j, k]]
                    distance[i, j, k] = to_triangle(point, vertices[f[0]], vertices[f[1]], vertices[f[2]])


@numba.njit(cache=True)
def _sweep(vertices, faces, origin, voxel, distance, nearest, backwards):  # type: ignore[no-untyped-def]
    """Let each voxel try the nearest faces of its three neighbours behind."""
    point, step = np.empty(3), -1 if backwards else 1
    n0, n1, n2 = distance.shape
    for a in range(n0):
        i = n0 - 1 - a if backwards else a
        for b in range(n1):
            j = n1 - 1 - b if backwards else b
            for c in range(n2):
                k = n2 - 1 - c if backwards else c
                for side in range(3):
                    u, v, w = i - step * (side == 0), j - step * (side == 1), k - step * (side == 2)
                    if not (0 <= u < n0 and 0 <= v < n1 and 0 <= w < n2) or nearest[u, v, w] == nearest[i, j, k]:
                        continue
                    point[0], point[1], point[2] = origin[0] + voxel * i, origin[1] + voxel * j, origin[2] + voxel * k
                    f = faces[nearest[u, v, w]]
                    d = to_triangle(point, vertices[f[0]], vertices[f[1]], vertices[f[2]])
                    if d < distance[i, j, k]:
                        distance[i, j, k] = d
                        nearest[i, j, k] = nearest[u, v, w]


@numba.njit(cache=True)
def _crossings(vertices, faces, origin, voxel, crossings):  # type: ignore[no-untyped-def]
    """Add +-1 to the last voxel below each crossing of a vertical line of voxels with the mesh."""
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first_i = max(0, math.ceil((min(a[0], b[0], c[0]) - origin[0]) / voxel))
        last_i = min(crossings.shape[0] - 1, math.floor((max(a[0], b[0], c[0]) - origin[0]) / voxel))
        first_j = max(0, math.ceil((min(a[1], b[1], c[1]) - origin[1]) / voxel))
        last_j = min(crossings.shape[1] - 1, math.floor((max(a[1], b[1], c[1]) - origin[1]) / voxel))
        for i in range(first_i, last_i + 1):
            x = origin[0] + voxel * (i + 1.7e-6)  # off the mesh's own vertices and edges: each crossing counts once
            for j in range(first_j, last_j + 1):
                y = origin[1] + voxel * (j + 2.3e-6)
                u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                k = math.floor((u * a[2] + v * b[2] + w * c[2] - origin[2]) / voxel)
                if k >= 0:
                    crossings[i, j, min(k, crossings.shape[2] - 1)] += 1 if area > 0.0 else -1


@numba.njit(cache=True)
def to_triangle(p, a, b, c):  # type: ignore[no-untyped-def]
    """Return the distance of a point to a triangle, by the region of its barycentric coordinates."""
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    ap0, ap1, ap2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1, d2 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2, ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    bb, cc = ab0 * ab0 + ab1 * ab1 + ab2 * ab2, ac0 * ac0 + ac1 * ac1 + ac2 * ac2
    bc = ab0 * ac0 + ab1 * ac1 + ab2 * ac2
    area = bb * cc - bc * bc
    if area > 0.0:
        v, w = (cc * d1 - bc * d2) / area, (bb * d2 - bc * d1) / area
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            return _length(ap0 - v * ab0 - w * ac0, ap1 - v * ab1 - w * ac1, ap2 - v * ab2 - w * ac2)
    return min(_to_edge(p, a, b), _to_edge(p, b, c), _to_edge(p, c, a))


@numba.njit(cache=True)
def _to_edge(p, a, b):  # type: ignore[no-untyped-def]
    e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    q0, q1, q2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    square = e0 * e0 + e1 * e1 + e2 * e2
    t = 0.0 if square == 0.0 else min(1.0, max(0.0, (e0 * q0 + e1 * q1 + e2 * q2) / square))
    return _length(q0 - t * e0, q1 - t * e1, q2 - t * e2)


@numba.njit(cache=True)
def _length(x, y, z):  # type: ignore[no-untyped-def]
    return math.sqrt(x * x + y * y + z * z)
