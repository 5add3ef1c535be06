"""Stage `denoise`: fills pixels that noise has replaced, and marks what has been put before the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numba
import numpy as np

from mocapflow.records import U8, Bool
from mocapflow_robustness.restoring import Restorer, mean_around

BLOCK_PX = 16  # noise is everywhere alike: its share is the median over blocks of the picture
LEAST_NOISE = 0.02  # share of lonely pixels; fine texture makes 0.004 at most on the recordings that we have
STRIP_PX = 3  # width of the strips that are left between things before the scene
CHANCE = 1e-9  # that noise spares a whole neighbourhood
RADIUS_PX = 2  # of the square of neighbours that are asked of a pixel
COMPANY = 2  # neighbours that have to agree with a pixel
TOLERANCE = 16  # grey levels by which the colours of neighbours that agree differ at most
FLAT_PX = 13  # side of a square of one colour that is not the scene's; compression makes small ones
FILL_PX = 1.0  # standard deviation of the window a lonely pixel is filled from


class Denoise(Restorer):
    """Fills pixels whose colour no neighbours share from those around them that have company.

    Random colours do not agree, so an intact pixel is known by its company however few are left: of 60 % noise, ten in
    a neighbourhood of 25 agree. Nothing is averaged over time or over colours that are right, so thin limbs stay sharp
    however fast they move. Where a picture full of noise has none, it does not show the scene; nor where all intact
    pixels of a large square have one colour to the last grey level, as little but a blank wall has. What is put before
    the scene in this way (rectangles, stripes, a logo) is hidden and counts neither way. A picture without noise stays
    as it is.
    """

    name: ClassVar[str] = "denoise"

    def restore(self, image: U8) -> tuple[U8, Bool]:
        """Return an image (H, W, 3) without its noise, and where (H, W) it does not show the scene."""
        kept = in_company(image, RADIUS_PX, TOLERANCE, COMPANY)
        share = noise_share(kept)
        if share < LEAST_NOISE:
            return image, np.zeros(kept.shape, bool)
        hidden = spared(kept, share) | flat(image, kept, FLAT_PX, least_side(share))
        return filled(image, kept & ~hidden, ~kept, FILL_PX), hidden


def noise_share(kept: Bool) -> float:
    """Return the share of lonely pixels, those not `kept` (H, W), in most of a picture."""
    import cv2

    height, width = (max(length // BLOCK_PX, 1) for length in kept.shape)
    return float(np.median(cv2.resize(1 - kept.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)))


def spared(kept: Bool, share: float) -> Bool:
    """Return the pixels (H, W) in squares without a lonely pixel that are larger than noise of this share leaves."""
    import cv2

    square = ones((least_side(1 - share),) * 2)
    return np.asarray(cv2.morphologyEx(kept.astype(np.uint8), cv2.MORPH_OPEN, square), bool)


def flat(image: U8, kept: Bool, side_px: int, least_px: int) -> Bool:
    """Return the pixels (H, W) of an image (H, W, 3) in squares whose `kept` ones all have the very same colour.

    Squares have a side of `side_px`, at least `least_px`. Near one of these a strip as long as that will do, and as
    large as the least square: strips are what is left of a rectangle by the next one. Of a picture of which too little
    is kept for any square to tell, nothing is flat.
    """
    if least_px > min(kept.shape):
        return np.zeros(kept.shape, bool)
    strip = (STRIP_PX, max(side_px, least_px**2 // STRIP_PX))
    sure, upright, level = of_one_colour(image, kept, [(max(side_px, least_px),) * 2, strip[::-1], strip])
    strips = (upright | level) & around(sure, 2 * side_px)
    return sure | (strips & around(strips & kept, STRIP_PX))  # a strip ends beside the last pixel kept of it


def around(chosen: Bool, size_px: int) -> Bool:
    """Return the pixels (H, W) in squares of this size round the chosen ones (H, W)."""
    import cv2

    return np.asarray(cv2.dilate(chosen.astype(np.uint8), ones((size_px,) * 2)), bool)


def of_one_colour(image: U8, kept: Bool, sizes_px: Sequence[tuple[int, int]]) -> list[Bool]:
    """Return the pixels (H, W) of an image (H, W, 3) in boxes whose `kept` ones have one colour, for each box size."""
    import cv2

    light, dark = (np.where(kept[..., None], image, lost).astype(np.uint8) for lost in (0, 255))
    boxes = [ones(size) for size in sizes_px]
    same = [np.all(cv2.dilate(light, box) == cv2.erode(dark, box), axis=2).astype(np.uint8) for box in boxes]
    return [np.asarray(cv2.dilate(middles, box), bool) for middles, box in zip(same, boxes, strict=True)]


def ones(size_px: tuple[int, int]) -> U8:
    """Return a box of ones of this height and width, or the next odd ones, so that it has a middle."""
    return np.ones([length | 1 for length in size_px], np.uint8)


def least_side(share: float) -> int:
    """Return the side of the smallest square that pixels of this share fill by chance as good as never; it is odd."""
    return int(np.ceil(np.sqrt(np.log(CHANCE) / np.log(np.clip(share, CHANCE, 1 - CHANCE))))) | 1


def filled(image: U8, known: Bool, wanted: Bool, sigma_px: float) -> U8:
    """Return an image (H, W, 3) with its `wanted` pixels (H, W) the Gaussian mean of the `known` ones around."""
    mean, share = mean_around(image, known, sigma_px)
    near = wanted & (share > 0)
    return np.where(near[..., None], np.rint(mean), image).astype(np.uint8)


@numba.njit(cache=True)
def in_company(image, radius, tolerance, company):  # type: ignore[no-untyped-def]
    """Return which pixels (H, W) have at least so many neighbours of their colour in an image (H, W, 3)."""
    height, width, _ = image.shape
    kept = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            blue, green, red = np.int32(image[y, x, 0]), np.int32(image[y, x, 1]), np.int32(image[y, x, 2])
            agree = -1  # with itself it does
            for v in range(max(y - radius, 0), min(y + radius + 1, height)):
                for u in range(max(x - radius, 0), min(x + radius + 1, width)):
                    agree += (
                        abs(np.int32(image[v, u, 0]) - blue) <= tolerance
                        and abs(np.int32(image[v, u, 1]) - green) <= tolerance
                        and abs(np.int32(image[v, u, 2]) - red) <= tolerance
                    )
                if agree >= company:
                    kept[y, x] = True
                    break
    return kept
