"""Cross-sections of a body and the taut outlines a garment lies on."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from mocapflow.assets import Body
from mocapflow.records import F64, record


@record
class Plane:
    """A plane with its own axes: a point on it and two unit directions across it."""

    point: F64
    across: F64  # (2, 3)

    @property
    def normal(self) -> F64:
        """The unit normal of the plane."""
        return np.cross(self.across[0], self.across[1])

    def lift(self, flat: F64) -> F64:
        """Return the points (..., 3) in the world of points (..., 2) in the plane."""
        return self.point + flat @ self.across


def level(height: float, towards: float = 0.0) -> Plane:
    """Return the horizontal plane at a height in m; its first axis points `towards` rad from x."""
    c, s = np.cos(towards), np.sin(towards)
    return Plane(point=np.array([0.0, 0.0, height]), across=np.array([[c, s, 0.0], [-s, c, 0.0]]))


def sections(body: Body, plane: Plane) -> list[F64]:
    """Return the separate cross-sections of the rest body, each as the crossing points (N, 2) m in the plane."""
    side = (body.vertices - plane.point) @ plane.normal
    above = (side[body.faces] > 0).sum(axis=1)
    faces = body.faces[(above > 0) & (above < 3)]
    if not len(faces):
        return []
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    crossing = (side[edges] > 0).sum(axis=1) == 1
    unique, which = np.unique(edges[crossing], axis=0, return_inverse=True)
    pairs = which.reshape(-1, 2)  # a cut face crosses the plane at two of its edges
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(unique), len(unique)))
    count, label = connected_components(graph, directed=False)
    share = side[unique[:, 0]] / (side[unique[:, 0]] - side[unique[:, 1]])
    ends = body.vertices[unique]
    points = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    flat = (points - plane.point) @ plane.across.T
    return [flat[label == k] for k in range(count) if (label == k).sum() > 2]


def outline(points: F64) -> F64:
    """Return the convex outline (N, 2) of points, counter-clockwise: what a taut band lies on."""
    return points[ConvexHull(points).vertices]


def outlines(body: Body, plane: Plane) -> list[F64]:
    """Return the outlines (N, 2) m of all that a plane cuts of the rest body."""
    return [outline(points) for points in sections(body, plane)]


def perimeter(closed: F64) -> float:
    """Return the length of a closed polygon (N, 2)."""
    return float(np.linalg.norm(closed - np.roll(closed, 1, axis=0), axis=1).sum())


def band(closed: F64, away: float, count: int, first: float = 0.0) -> tuple[F64, F64]:
    """Return `count` points evenly along a convex outline moved outwards by `away` m, and where each one faces.

    The band begins where it faces the first axis of the plane; the first point lies `first` spacings on. The
    directions turn evenly along the band: so spread the strands of a cloth that is cut wider at the other end by
    the same amount everywhere.
    """
    angles = 2 * np.pi * np.arange(4096) / 4096
    facing = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    support = closed[np.argmax(closed @ facing.T, axis=0)] + away * facing
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(support, axis=0, append=support[:1]), axis=1))])
    at = along[-1] * (np.arange(count) + first) / count
    ring = np.stack([np.interp(at, along, np.append(support[:, k], support[0, k])) for k in range(2)], axis=1)
    turns = 2 * np.pi * (np.arange(count) + first) / count
    return ring, np.stack([np.cos(turns), np.sin(turns)], axis=1)
