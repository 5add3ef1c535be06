"""Stage `bilateral`: smooths noise that is added to every pixel, by what it measures of it, and keeps edges."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from mocapflow.records import F32, F64, U8, Bool
from mocapflow_robustness.restoring import Restorer, mean_around

MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)  # blind to planes and to straight edges
MAGNITUDE = np.sqrt(2 / np.pi)  # the mean of a normal variable's, in standard deviations
FREE = 0.1  # share of the picture's noise below which a place has none
SIDE = 7  # px, of such a place
ENOUGH = 0.9  # share of a blur's window that has to show the scene: beside what hides it, noise is left
LEAST_NOISE = 8.0  # grey levels, standard deviation; cameras make less
SPACE_PX = 4.0  # standard deviation of the filter in the picture
COLOUR = 40.0  # standard deviation of the filter in colours, grey levels
PASSES = 3  # of the filter, one after the other


class Bilateral(Restorer):
    """Blurs as much as the noise of each picture asks for, then smooths colours that are alike.

    Values that noise has pushed out of the range were cut off, which takes contrast: it is given back. Where a picture
    full of noise has none, it does not show the scene: what was put before it (rectangles, stripes, a logo) is hidden
    and counts neither way. A picture with little noise stays as it is.

    Source: Immerkaer 1996 (the noise); Tomasi and Manduchi 1998 (the filter)
    """

    name: ClassVar[str] = "bilateral"
    noise_left: PositiveFloat = 16.0  # grey levels of noise that the blur may leave

    def restore(self, image: U8) -> tuple[U8, Bool]:
        """Return an image (H, W, 3) without its noise, and where (H, W) it does not show the scene."""
        import cv2

        rough = roughness(image)
        noise = noise_of(rough)
        if noise < LEAST_NOISE:
            return image, np.zeros(rough.shape, bool)
        flat = (rough < FREE * noise).astype(np.uint8)
        hidden = np.asarray(cv2.dilate(flat, np.ones((SIDE, SIDE), np.uint8)), bool)
        smooth, share = mean_around(image, ~hidden, noise / (2 * np.sqrt(np.pi) * self.noise_left))
        hidden |= share < ENOUGH
        for _ in range(PASSES):
            smooth = np.asarray(cv2.bilateralFilter(smooth, -1, COLOUR, SPACE_PX), np.float32)
        return unclipped(smooth, noise), hidden


def roughness(image: U8) -> F32:
    """Return how rough (H, W) an image (H, W, 3) is around each pixel: the mean size of its noise in grey levels."""
    import cv2

    fine = np.abs(cv2.filter2D(image.astype(np.float32), -1, MASK)).mean(axis=2)
    return np.asarray(cv2.blur(fine, (SIDE, SIDE)) / np.float32(np.linalg.norm(MASK)), np.float32)


def noise_of(rough: F32) -> float:
    """Return the standard deviation of the noise in most of a picture, in grey levels, from how rough (H, W) it is."""
    return float(np.median(rough) / MAGNITUDE)


def unclipped(image: F32, noise: float) -> U8:
    """Return the image (H, W, 3) of which this is the mean once noise of a standard deviation was cut to the range."""
    levels = np.arange(256.0)
    return np.asarray(np.rint(np.interp(image, mean_clipped(levels, noise), levels)), np.uint8)


def mean_clipped(levels: F64, noise: float) -> F64:
    """Return the means (N,) of grey levels (N,) with uniform noise of a standard deviation, cut to 0..255."""
    reach = noise * np.sqrt(3)
    mean: F64 = np.clip(levels[:, None] + np.linspace(-reach, reach, 513), 0, 255).mean(axis=1)
    return mean
