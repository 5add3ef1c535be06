"""From what a lens shows to what the steps see: an undistorted, resized image of a pinhole camera."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import bends, pinhole, scaled, undistort
from mocapflow.records import F64, U8, Bool, array, record


@record
class View:
    """A lens and the camera that remains once its images are resized and undistorted.

    Images are made smaller first: undistorting costs per pixel.
    """

    lens: Camera
    scale: float = 1.0
    levels: U8 | None = array(256, 3, unit="grey level that each one of blue, green and red becomes", default=None)
    occluder: Bool | None = array("H", "W", unit="where something stands before all else; None: nowhere", default=None)

    @cached_property
    def camera(self) -> Camera:
        """The pinhole camera of `image`'s results."""
        return pinhole(scaled(self.lens, self.scale))

    def image(self, image: U8 | None) -> U8:
        """Return an image (H, W, 3) of the lens at these levels, resized and undistorted; black where it is lost."""
        import cv2

        width, height = (int(n) for n in self.camera.size)
        if image is None:
            return np.zeros((height, width, 3), np.uint8)
        image = with_levels(image, self.levels)
        if image.shape[:2] != (height, width):
            image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        if self._maps is None:
            return image
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.uint8)

    @cached_property
    def hidden(self) -> Bool | None:
        """Where (H, W) `image`'s results show what stands before all else; None: nowhere."""
        if self.occluder is None:
            return None
        white = np.where(self.occluder[..., None], 255, np.zeros(3)).astype(np.uint8)
        return np.asarray(replace(self, levels=None, occluder=None).image(white)[..., 0] > 0)

    def points(self, points: F64) -> F64:
        """Return keypoints (N, K, 3: px, px, confidence) of the lens where they are in `image`'s results.

        One that is not seen, or lies where the lens' model shows nothing, is at (0, 0) with confidence 0.
        """
        if not points.size:
            return points
        moved = points.copy()
        pixels = undistort(points[..., :2].reshape(-1, 2), self.lens)
        factor = self.camera.size / self.lens.size
        moved[..., :2] = ((pixels + 0.5) * factor - 0.5).reshape(*points.shape[:2], 2)
        moved[(points[..., 2] <= 0) | np.isnan(moved[..., 0])] = 0.0
        return moved

    @cached_property
    def _maps(self) -> tuple[Any, Any] | None:
        import cv2

        if not bends(self.lens):
            return None
        k, size = self.camera.intrinsics, (int(self.camera.size[0]), int(self.camera.size[1]))
        if self.lens.fisheye:
            return cv2.fisheye.initUndistortRectifyMap(k, self.lens.distortion[:4], np.eye(3), k, size, cv2.CV_16SC2)
        return cv2.initUndistortRectifyMap(k, self.lens.distortion, np.eye(3), k, size, cv2.CV_16SC2)


def with_levels(image: U8, levels: U8 | None) -> U8:
    """Return an image (H, W, 3) whose grey levels became those of a table (256, 3) by colour; None: the same."""
    import cv2

    return image if levels is None else np.asarray(cv2.LUT(image, levels[None]), np.uint8)
