"""Where the model's outline has moved since the turn before: only there does the image have more to say."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Change, Surface
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.records import Bool

SPACING_PX = 4.0  # between the points of the outline that are looked at


def moved_outline(surface: Surface, change: Change, camera: Camera, least_px: float) -> Bool | None:
    """Return True (H, W) where points of the outline that moved across it by more than `least_px` are, and were.

    A point that slides along the outline leaves it as it is. None where nobody knows: the change does not say how
    vertices moved, or the surface has left the view.
    """
    if change.shift is None:
        return None
    outline = occluding_contour(surface, camera, SPACING_PX)
    if not len(outline.vertex):
        return None
    there = surface.vertices.take(outline.vertex, axis=0)
    before, now = project(there - change.shift.take(outline.vertex, axis=0), camera), project(there, camera)
    far = np.abs(np.einsum("ka,ka->k", now - before, outline.normal)) > least_px
    moved = np.zeros((camera.size[1], camera.size[0]), bool)
    x, y = np.rint(np.concatenate([before[far], now[far]])).astype(int).T
    seen = (x >= 0) & (y >= 0) & (x < camera.size[0]) & (y < camera.size[1])
    moved[y[seen], x[seen]] = True
    return moved
