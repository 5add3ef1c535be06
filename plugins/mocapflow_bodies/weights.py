"""Skinning weights computed from the distances to the bones, and weights kept to five joints a vertex."""

from __future__ import annotations

import numpy as np

from mocapflow.geometry.skeleton import Skeleton, to_segment
from mocapflow.records import F64, I32

KEPT = 5  # joints a vertex
LEAST = 0.01  # weights below are dropped
HEAT = 2.0  # how strongly the nearest bone holds a vertex; weights fall within about one segment radius


def heat_weights(vertices: F64, faces: I32, skeleton: Skeleton) -> F64:
    """Return weights (V, J) as heat that flows over the skin from the nearest bone of each vertex.

    Solves `-laplace w + h (w - nearest) = 0` with h = HEAT / distance^2, the equilibrium of Baran & Popović 2007.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    distance = bone_distances(vertices, skeleton)
    nearest = distance.argmin(axis=1)
    reach = np.maximum(distance.min(axis=1), 0.005)
    stiffness, area = _laplacian(vertices, faces)
    hold = area * HEAT / reach**2
    target = np.zeros_like(distance)
    target[np.arange(len(vertices)), nearest] = hold
    return np.clip(np.asarray(splu((stiffness + diags(hold)).tocsc()).solve(target)), 0.0, None)


def bone_distances(vertices: F64, skeleton: Skeleton) -> F64:
    """Return the distance (V, J) m of each vertex to what each joint carries: the bones to its children."""
    distance = np.full((len(vertices), len(skeleton.names)), np.inf)
    for joint in range(len(skeleton.names)):
        ends = skeleton.positions[skeleton.parents == joint]
        if not len(ends):
            ends = (skeleton.positions[joint] + 0.5 * skeleton.bone(joint))[None]
        for end in ends:
            distance[:, joint] = np.minimum(distance[:, joint], to_segment(vertices, skeleton.positions[joint], end))
    return distance


def strongest(weights: F64) -> tuple[I32, F64]:
    """Return joints (V, 5) and weights (V, 5) of the strongest joints of each vertex; rows sum to one."""
    wide = np.pad(weights, ((0, 0), (0, max(0, KEPT - weights.shape[1]))))
    order = np.argsort(-wide, axis=1, kind="stable")[:, :KEPT]
    kept = np.take_along_axis(wide, order, axis=1)
    kept = np.where(kept >= LEAST * kept.sum(axis=1, keepdims=True), kept, 0.0)
    joints = np.where(kept > 0, order, order[:, :1])
    return joints.astype(np.int32), kept / kept.sum(axis=1, keepdims=True)


def _laplacian(vertices: F64, faces: I32):  # type: ignore[no-untyped-def]
    """Return the cotangent matrix (V, V) and the area (V,) of each vertex."""
    from scipy.sparse import coo_matrix, diags

    count = len(vertices)
    rows, columns, values = [], [], []
    area = np.full(count, 1e-10)
    for corner in range(3):
        a, b, c = (faces[:, (corner + k) % 3] for k in range(3))
        u, w = vertices[b] - vertices[a], vertices[c] - vertices[a]
        twice = np.linalg.norm(np.cross(u, w), axis=1)
        cotangent = np.clip(np.sum(u * w, axis=1) / np.maximum(twice, 1e-12), 0.01, 10.0) / 2
        np.add.at(area, a, twice / 6)
        rows += [b, c]
        columns += [c, b]
        values += [cotangent, cotangent]
    near = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)).tocsr()
    return diags(np.asarray(near.sum(axis=1)).ravel()) - near, area
