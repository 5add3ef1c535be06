"""Triangle meshes: edges with their faces, vertex normals."""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow.records import F64, I32


def edges(faces: I32) -> I32:
    """Return each edge once with the faces beside it.

    Args:
        faces: (F, 3) vertex indices.

    Returns:
        (E, 4): vertices a, b, the face that runs a to b, the face that runs b to a; -1 where there is none.
        A third face on an edge, or two that run the same way, count as edges of their own.
    """
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    key = np.minimum(start, end).astype(np.int64) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.lexsort((start > end, key))
    key, start, end, face = key[order], start[order], end[order], face[order]
    pairs = (key[:-1] == key[1:]) & (start[:-1] < end[:-1]) & (start[1:] > end[1:])
    left = np.flatnonzero(pairs)
    single = np.setdiff1d(np.arange(len(key)), np.concatenate([left, left + 1]))
    paired = np.column_stack([start[left], end[left], face[left], face[left + 1]])
    alone = np.column_stack([start[single], end[single], face[single], np.full(len(single), -1)])
    return np.concatenate([paired, alone]).astype(np.int32)


def vertex_normals(vertices: F64, faces: I32) -> F64:
    """Return unit vertex normals (N, 3), the mean of the face normals weighted by area."""
    normals = np.zeros_like(vertices)
    _add_face_normals(vertices, faces, normals)
    return normals


def lengths_along(vertices: F64, strands: I32) -> F64:
    """Return the length (W,) along its strand from the first vertex to each vertex; strands (N, L) are -1 padded."""
    ahead = np.linalg.norm(np.diff(vertices[strands], axis=1), axis=2)
    reached = np.concatenate([np.zeros((len(strands), 1)), np.cumsum(ahead, axis=1)], axis=1)
    lengths = np.zeros(len(vertices))
    lengths[strands[strands >= 0]] = reached[strands >= 0]
    return lengths


@numba.njit(cache=True)
def _add_face_normals(vertices, faces, normals):  # type: ignore[no-untyped-def]
    index = numba.uint64  # unsigned: nothing is checked for counting from the end
    for f in range(len(faces)):
        a, b, c = index(faces[f, 0]), index(faces[f, 1]), index(faces[f, 2])
        ux, wx = vertices[b, 0] - vertices[a, 0], vertices[c, 0] - vertices[a, 0]
        uy, wy = vertices[b, 1] - vertices[a, 1], vertices[c, 1] - vertices[a, 1]
        uz, wz = vertices[b, 2] - vertices[a, 2], vertices[c, 2] - vertices[a, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        for corner in (a, b, c):
            normals[corner, 0] += nx
            normals[corner, 1] += ny
            normals[corner, 2] += nz
    for v in range(len(normals)):
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        square = x * x + y * y + z * z
        scale = 1.0 / math.sqrt(square) if square > 0 else 0.0
        normals[v, 0], normals[v, 1], normals[v, 2] = scale * x, scale * y, scale * z
