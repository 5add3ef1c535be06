"""Where the body meets what it stands on: both sides of its contour lie in their shadow, and brightness misleads."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.records import Bool

NEAR_M = 0.04  # above the lowest point of the body: what shades the floor right beside itself
DOWNWARD = 0.3  # least part of an outward normal that points down the image
SPACING_PX = 4.0
REACH_PX = 6  # to either side of the outline


def contact_zone(surface: Surface, camera: Camera) -> Bool:
    """Return the pixels (H, W) near where the surface's outline faces down, near its lowest point."""
    import cv2

    outline = occluding_contour(surface, camera, SPACING_PX)
    height = surface.vertices[:, 2]
    meets = (height[outline.vertex] < height.min() + NEAR_M) & (outline.normal[:, 1] > DOWNWARD)
    zone = np.zeros((camera.size[1], camera.size[0]), np.uint8)
    for x, y in np.rint(outline.pixel[meets]).astype(int):
        cv2.circle(zone, (int(x), int(y)), REACH_PX, 1, cv2.FILLED)
    return zone.view(bool)
