"""Where the person can throw a shadow: on the floor around their feet."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.cameras import project
from mocapflow.once import once
from mocapflow.records import F64, Bool

CORNERS = 72
REACH_M = 2.0  # from the person, where their shadow may fall


@once
def _circle(surface: Surface, radius_m: float) -> F64:
    """Return points (CORNERS, 3) m of a circle around the person, on the floor."""
    feet = surface.vertices[:, 2].min()
    middle = surface.vertices[:, :2].mean(axis=0)
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle = middle + radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.column_stack([circle, np.full(CORNERS, feet)])


def floor_around(surface: Surface, camera: Camera, reach_m: float = REACH_M) -> Bool:
    """Return True for pixels (H, W) that show the floor within reach of the person.

    The floor is the horizontal plane through the lowest point of the posed surface. Elsewhere, a darker pixel of
    the same chromaticity is no shadow: grey cloth before a grey wall.
    """
    import cv2

    pixels = project(_circle(surface, reach_m), camera)
    mask = np.zeros((camera.size[1], camera.size[0]), np.uint8)
    if not np.isfinite(pixels).all():  # the camera stands within reach
        mask[:] = 1
        return mask.view(bool)
    corners = np.rint(np.clip(pixels, -1e5, 1e5)).astype(np.int32)
    cv2.fillConvexPoly(mask, corners, 1)
    return mask.view(bool)
