"""Which pixels count: not the border of the image, and not what continues beyond the model's cut edge."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Body, Camera
from mocapflow.data import Surface
from mocapflow.geometry.cameras import project
from mocapflow.records import F32, Bool

RIM_TOLERANCE_PX = 1.5  # a pixel whose distances to rim and outline agree this well lies beyond the rim


def counted(shape: tuple[int, int], border_px: int, hidden: Bool | None = None) -> Bool:
    """Return True for the pixels of an image (H, W) that count, not for its border and where the person is hidden."""
    counts = np.zeros(shape, bool)
    counts[border_px : shape[0] - border_px, border_px : shape[1] - border_px] = True
    if hidden is not None:
        counts &= ~hidden
    return counts


def without_cut(counts: Bool, model: F32, body: Body, surface: Surface, camera: Camera) -> Bool:
    """Return which pixels (H, W) count, without those where the nearest part of the model's outline is its cut edge.

    There the person goes on although the model ends, so the image must not pull at the contour.

    Args:
        counts: (H, W) True where a pixel counts.
        model: (H, W) signed distance to the model's outline, positive inside.
        body: knows which vertices lie on the rim.
        surface: the posed mesh, body vertices first.
        camera: the view, without distortion.
    """
    import cv2

    if not body.cut.any():
        return counts
    pixels = project(surface.vertices[: len(body.vertices)][body.cut], camera)
    pixels = pixels[np.isfinite(pixels).all(axis=1)].astype(np.float32)
    if not len(pixels):  # behind the camera
        return counts
    hull = cv2.convexHull(pixels)
    off_rim = np.ones(counts.shape, np.uint8)
    cv2.fillConvexPoly(off_rim, np.rint(hull).astype(np.int32), 0)
    to_rim = cv2.distanceTransform(off_rim, cv2.DIST_L2, 5)
    to_model = cv2.distanceTransform((model <= 0).astype(np.uint8), cv2.DIST_L2, 5)
    depth = np.where(model > 0, np.abs(model), to_model)
    return counts & (to_rim > depth + RIM_TOLERANCE_PX)
