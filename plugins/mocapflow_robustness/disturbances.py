"""Pictures spoiled at random: noise, rectangles, a stripe, torn lines. A generator decides, nothing is remembered."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mocapflow.records import U8

SIDES = 0.05, 0.25  # of a rectangle, shares of the picture
BAND = 0.02, 0.15  # height of a torn band, share of the picture
GARBAGE = 0.5  # share of torn bands whose content is lost too
BLOCK = 8  # px, of garbage, as damaged video shows it


def noisy(image: U8, share: float, kind: Literal["replaced", "added"], rng: np.random.Generator) -> U8:
    """Return an image (H, W, 3) with uncorrelated noise.

    Args:
        image: (H, W, 3) BGR.
        share: of the pixels that get a random colour; or of the range, the reach of noise added to every value.
        kind: which of the two.
        rng: decides.
    """
    if kind == "added":
        reach = 255 * share
        moved = image + rng.uniform(-reach, reach, image.shape)
        return np.clip(np.rint(moved), 0, 255).astype(np.uint8)
    lost = rng.random(image.shape[:2], np.float32) < share
    spoiled = image.copy()
    spoiled[lost] = rng.integers(0, 256, (np.count_nonzero(lost), 3), np.uint8)
    return spoiled


def with_rectangles(image: U8, count: tuple[int, int], rng: np.random.Generator) -> U8:
    """Return an image (H, W, 3) behind rectangles of random place, size and grey; between `count` of them."""
    spoiled, size = image.copy(), np.array(image.shape[:2])
    for _ in range(rng.integers(count[0], count[1] + 1)):
        height, width = np.maximum(np.rint(rng.uniform(*SIDES, 2) * size), 1).astype(int)
        top, left = rng.integers(0, size - [height, width] + 1)
        spoiled[top : top + height, left : left + width] = rng.integers(0, 256)
    return spoiled


def with_stripe(image: U8, share: float, centre: float) -> U8:
    """Return an image (H, W, 3) behind a black stripe over its width; share and centre are shares of its height."""
    height = len(image)
    first, last = (round(height * float(np.clip(centre + side * share / 2, 0, 1))) for side in (-1, 1))
    return covered(image, first, last)


def covered(image: U8, first: int, last: int) -> U8:
    """Return an image (H, W, 3) whose rows from `first` up to `last` are black."""
    spoiled = image.copy()
    spoiled[first:last] = 0
    return spoiled


def torn(image: U8, rng: np.random.Generator) -> U8:
    """Return an image (H, W, 3) in bands that slipped sideways or hold garbage, as a damaged transfer leaves it."""
    spoiled = image.copy()
    height, width = image.shape[:2]
    top = 0
    while top < height:
        band = slice(top, top + max(round(height * rng.uniform(*BAND)), 1))
        rows = spoiled[band]
        if rng.random() < GARBAGE:
            blocks = rng.integers(0, 256, (-(-len(rows) // BLOCK), -(-width // BLOCK), 3), np.uint8)
            rows[:] = np.repeat(np.repeat(blocks, BLOCK, axis=0), BLOCK, axis=1)[: len(rows), :width]
        else:
            rows[:] = np.roll(rows, rng.integers(width // 8, width - width // 8), axis=1)
        top = band.stop
    return spoiled
