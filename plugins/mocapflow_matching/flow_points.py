"""2D-3D pairs from image flow: the surface point seen in the frame before, and where it is now."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Frame, Matches, Past, Surface, empty_matches
from mocapflow.geometry.cameras import project_each
from mocapflow.geometry.visibility import front_vertices
from mocapflow.pooling import pool
from mocapflow.records import F64, I32
from mocapflow.scene import Scene

CLOTH_SHARE = 0.2  # weight of a point on cloth, over that of one on skin: cloth slides


def flow_points(frame: Frame, past: Past, scene: Scene) -> Matches:
    """Return the tracked points that lie on the surface of the frame before, each with unit weight.

    A point lies between vertices; the nearest vertex of what is seen there stands for it and is shifted as it is.
    """
    if frame.flow is None or not past.moments or past.moments[-1].blind:  # a pose that nobody saw carries nothing
        return empty_matches()
    before = past.moments[-1]
    surface = scene.surface(before.pose, before.cloth)
    parts = []
    for index, flow in enumerate(frame.flow):
        if frame.usable[index] and len(flow.pixel):
            vertex, image = front_vertices(surface, scene.cameras[index], flow.pixel.astype(np.float64))
            on = vertex >= 0
            parts.append(_pairs(index, image[vertex[on]] + flow.displacement[on], vertex[on]))
    return pool(parts)


def _pairs(camera: int, pixel: F64, vertex: I32) -> Matches:
    return Matches(
        camera=np.full(len(vertex), camera, np.int16),
        pixel=pixel,
        direction=np.zeros_like(pixel),
        vertex=vertex,
        weight=np.ones(len(vertex)),
    )


def distances(matches: Matches, surface: Surface, scene: Scene) -> F64:
    """Return how far (M,) px the vertices of matches are from their targets."""
    image = project_each(surface.vertices[matches.vertex], matches.camera, scene.cameras)
    return np.asarray(np.linalg.norm(image - matches.pixel, axis=1))
