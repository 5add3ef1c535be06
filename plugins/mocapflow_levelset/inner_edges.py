"""Where the model shows one of its parts before another: occluding edges inside its silhouette."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Contour, Surface
from mocapflow.geometry import boundary_kernels
from mocapflow.geometry.cameras import projection
from mocapflow.geometry.silhouettes import outline
from mocapflow.geometry.visibility import front_vertices
from mocapflow.records import F64, I32, Bool

ASIDE = 2.0  # px from an edge at which its two sides are looked up
NEAR = 0.1  # m from an edge within which what is seen there is the part that ends at it


def inner_edges(surface: Surface, camera: Camera, spacing_px: float, of: Bool) -> Contour:
    """Return points on the occluding edges inside the silhouette of a surface, hidden ones too, evenly spaced.

    Args:
        surface: the posed mesh.
        camera: the view.
        spacing_px: between points.
        of: (N,) the vertices between which edges are wanted.
    """
    occluding = outline(surface, camera)
    wanted = np.asarray(of.take(occluding.vertex).all(axis=1))
    wanted[occluding.edge] = False  # these bound the silhouette
    edge = np.flatnonzero(wanted).astype(np.int32)
    vertex, anchor, pixel, normal = boundary_kernels.sample(
        occluding.image.take(edge, axis=0), edge, occluding.vertex, occluding.image,
        surface.vertices, surface.normals, surface.cloth, projection(camera), camera.size, 0, spacing_px,
    )  # fmt: skip
    return Contour(vertex=vertex, anchor=anchor, pixel=pixel, normal=normal)


def behind_edges(surface: Surface, camera: Camera, edges: Contour) -> I32:
    """Return the vertex (K,) that is seen just beyond each point of edges; -1: nothing is, or the edge is hidden."""
    sides = np.concatenate([edges.pixel - ASIDE * edges.normal, edges.pixel + ASIDE * edges.normal])
    seen, _ = front_vertices(surface, camera, sides)
    before, behind = seen.reshape(2, -1)
    away: F64 = np.linalg.norm(surface.vertices[before] - surface.vertices[edges.vertex], axis=1)
    return np.where((before >= 0) & (away < NEAR), behind, np.int32(-1))
