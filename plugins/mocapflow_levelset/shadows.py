"""Where the person can throw a shadow: on the floor around their feet."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.cameras import project
from mocapflow.records import Bool

CORNERS = 72


def floor_around(surface: Surface, camera: Camera, reach_m: float) -> Bool:
    """Return True for pixels (H, W) that show the floor within reach of the person.

    The floor is the horizontal plane through the lowest point of the posed surface. Elsewhere, a darker pixel of
    the same chromaticity is no shadow: grey cloth before a grey wall.
    """
    import cv2

    feet = surface.vertices[:, 2].min()
    middle = surface.vertices[:, :2].mean(axis=0)
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle = middle + reach_m * np.column_stack([np.cos(angles), np.sin(angles)])
    pixels = project(np.column_stack([circle, np.full(CORNERS, feet)]), camera)
    mask = np.zeros((camera.size[1], camera.size[0]), np.uint8)
    if not np.isfinite(pixels).all():  # the camera stands within reach
        mask[:] = 1
        return mask.view(bool)
    corners = np.rint(np.clip(pixels, -1e5, 1e5)).astype(np.int32)
    cv2.fillConvexPoly(mask, corners, 1)
    return mask.view(bool)
