"""The part of an image around a start contour, and its coarser copies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from mocapflow.records import F32, U8, Bool

Value = TypeVar("Value", bound=np.generic)
Number = TypeVar("Number", np.uint8, np.float32)


class Crop(NamedTuple):
    """A rectangle of an image: rows top to bottom, columns left to right, ends excluded."""

    top: int
    bottom: int
    left: int
    right: int

    def of(self, image: npt.NDArray[Value]) -> npt.NDArray[Value]:
        """Return the rectangle of an image, (h, w, ...)."""
        return image[self.top : self.bottom, self.left : self.right]

    def within(self, other: Crop) -> Crop:
        """Return this rectangle in an image that is cut to another one around it."""
        return Crop(self.top - other.top, self.bottom - other.top, self.left - other.left, self.right - other.left)

    def at(self, factor: int) -> Crop:
        """Return the rectangle of the image at 1 / factor of its size; its sides must be multiples of the factor."""
        return Crop(*(side // factor for side in self))


def around(level: F32 | Bool, margin_px: int, multiple: int) -> Crop | None:
    """Return the rectangle around the inside of a level set (H, W), its sides at multiples of `multiple`.

    None where nothing is inside.
    """
    import cv2

    inside = level if level.dtype == bool else level > 0  # a comparison of booleans takes longer than the rest
    x, y, width, height = cv2.boundingRect(inside.view(np.uint8))
    if not width:
        return None
    top, bottom = _widened(y, y + height, level.shape[0], margin_px, multiple)
    left, right = _widened(x, x + width, level.shape[1], margin_px, multiple)
    return Crop(top, bottom, left, right)


def _widened(first: int, last: int, length: int, margin: int, multiple: int) -> tuple[int, int]:
    """Return an interval with a margin, within the image, its ends rounded outward (or in, at the image's end)."""
    first, last = max(first - margin, 0), min(last + margin, length)
    return first // multiple * multiple, min(-(-last // multiple), length // multiple) * multiple


def shrink(image: npt.NDArray[Number], factor: int) -> npt.NDArray[Number]:
    """Return an array (H, W, ...) at 1 / factor of its size, the mean of each square of pixels.

    What is left over at the right and at the bottom is dropped.
    """
    import cv2

    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    whole = image[: height * factor, : width * factor]
    if factor > 2 and factor % 2 == 0:  # twice halved takes a fifth of the time of a quarter at once
        return shrink(shrink(whole, 2), factor // 2)
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), image.dtype)


def pyramid(image: U8, factors: Iterable[int]) -> dict[int, U8]:
    """Return an image (H, W, 3) at 1 / factor of its size by factors, each a multiple of the one before."""
    images, factor = {1: image}, 1
    for wanted in sorted(factors):
        images[wanted], factor = shrink(images[factor], wanted // factor), wanted
    return images


def coarser(level: F32, factor: int) -> F32:
    """Return a level set (H, W) in fine px on a grid `factor` times coarser, in coarse px."""
    return level.copy() if factor == 1 else shrink(level, factor) / np.float32(factor)


def finer(level: F32, factor: int) -> F32:
    """Return a level set (H, W) in coarse px on a grid `factor` times finer, in fine px."""
    import cv2

    size = (level.shape[1] * factor, level.shape[0] * factor)
    return np.asarray(cv2.resize(level * np.float32(factor), size, interpolation=cv2.INTER_LINEAR), np.float32)


def shrink_mask(mask: Bool, factor: int) -> Bool:
    """Return a mask (H, W) at 1 / factor of its size, by the pixel nearest to the middle of each square."""
    rows, columns = (length // factor * factor for length in mask.shape)
    return np.ascontiguousarray(mask[factor // 2 : rows : factor, factor // 2 : columns : factor])
