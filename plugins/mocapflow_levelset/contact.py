"""Where the body meets what it stands on: both sides of its contour lie in their shadow, and brightness misleads."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Surface
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.records import Bool

NEAR_M = 0.04  # above the lowest point of the body: what shades the floor right beside itself
DOWNWARD = 0.3  # least part of an outward normal that points down the image
SPACING_PX = 2.0


def contact_zone(surface: Surface, camera: Camera, reach_px: float) -> Bool:
    """Return the pixels (H, W) within reach of where the surface's outline faces down, near its lowest point."""
    import cv2

    outline = occluding_contour(surface, camera, SPACING_PX)
    height = surface.vertices[:, 2]
    meets = (height[outline.vertex] < height.min() + NEAR_M) & (outline.normal[:, 1] > DOWNWARD)
    column, row = np.minimum(np.rint(outline.pixel[meets]).astype(int), camera.size - 1).T
    elsewhere = np.ones((camera.size[1], camera.size[0]), np.uint8)
    elsewhere[row, column] = 0
    return np.asarray(cv2.distanceTransform(elsewhere, cv2.DIST_L2, 3) < reach_px)
