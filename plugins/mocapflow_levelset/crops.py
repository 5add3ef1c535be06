"""The part of an image around a start contour, and its coarser copies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, U8


class Crop(NamedTuple):
    """A rectangle of an image: rows top to bottom, columns left to right, ends excluded."""

    top: int
    bottom: int
    left: int
    right: int

    def of(self, image: F32) -> F32:
        """Return the rectangle of an image, (h, w, ...)."""
        return image[self.top : self.bottom, self.left : self.right]

    def of_grey_levels(self, image: U8) -> U8:
        """Return the rectangle of an image of grey levels, (h, w, ...)."""
        return image[self.top : self.bottom, self.left : self.right]


def around(level: F32, margin_px: int, multiple: int) -> Crop | None:
    """Return the rectangle around the inside of a level set (H, W), its sides multiples of `multiple`.

    None where nothing is inside.
    """
    import cv2

    x, y, width, height = cv2.boundingRect((level > 0).view(np.uint8))
    if not width:
        return None
    top, bottom = _widen(y, y + height, level.shape[0], margin_px, multiple)
    left, right = _widen(x, x + width, level.shape[1], margin_px, multiple)
    return Crop(top, bottom, left, right)


def _widen(first: int, last: int, length: int, margin: int, multiple: int) -> tuple[int, int]:
    """Return an interval with a margin, within the image, its length rounded up (or down at the image's end)."""
    first, last = max(first - margin, 0), min(last + margin, length)
    wanted = -(-(last - first) // multiple) * multiple
    if first + wanted <= length:
        return first, first + wanted
    if wanted <= length:
        return length - wanted, length
    return 0, length // multiple * multiple


def shrink(image: U8, factor: int) -> U8:
    """Return an image at 1 / factor of its size, the mean of each square of pixels."""
    import cv2

    size = (image.shape[1] // factor, image.shape[0] // factor)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def shrink_values(image: F32, factor: int) -> F32:
    """Return an array at 1 / factor of its size, the mean of each square of pixels."""
    import cv2

    size = (image.shape[1] // factor, image.shape[0] // factor)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def enlarge(level: F32, factor: int) -> F32:
    """Return a level set in coarse px on a grid `factor` times finer, in fine px."""
    import cv2

    size = (level.shape[1] * factor, level.shape[0] * factor)
    return np.asarray(cv2.resize(level, size, interpolation=cv2.INTER_LINEAR) * factor, np.float32)
