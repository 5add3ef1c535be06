"""Colours of pixels compared: the same but for noise or a shadow, or of the kind that a room has."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, F64, I32, U8, Bool

ALIKE = 3.0  # standard deviations within which two colours of a pixel are the same
NOISE = 3.0  # grey levels, the least standard deviation
TINT, SHADE = 1.07, 2.0  # one colour in a shadow of the other: channels fall alike, to half of the levels at most
DEEP = 2.6  # the same, where feet may have stood close by: what `plates.Shadow` takes for a shadow, too
ROOM = 1.5  # times as common beside the person as on it: a colour of the room
RARE = 3e-4  # a colour that is rarer beside the person says nothing
BINS = (32, 64, 64)  # of lightness and the two colours of CIELAB
SMOOTH = 1.0  # bins, of the densities


class Colours(NamedTuple):
    """One colour of each pixel of a view."""

    mean: F32  # (H, W, 3) grey levels
    spread: F32  # (H, W, 3) standard deviation, grey levels
    share: F32  # (H, W) of the pictures that show it; 0: none is left


def more_common(beside: I32, on: I32) -> Bool:
    """Return for each colour whether it is more common among some pixels (N,) than among others (M,)."""
    return _density(beside) > ROOM * (_density(on) + RARE)


def alike(colour: Colours, other: F32) -> Bool:
    """Return where (H, W) a colour is another one but for noise."""
    near = np.abs(colour.mean - other) < ALIKE * np.maximum(colour.spread, NOISE)
    return every(near)


def shaded(colour: F32, other: F32, most: float = SHADE) -> Bool:
    """Return where (H, W) one of two colours is the other in a neutral shadow, which divides it by so much at most."""
    b, g, r = np.moveaxis((colour + 1) / (other + 1), 2, 0)
    low, high = np.minimum(np.minimum(b, g), r), np.maximum(np.maximum(b, g), r)
    found: Bool = (high < TINT * low) & (low > 1 / most) & (high < most)
    return found


def lab_bins(image: U8 | F32) -> I32:
    """Return the bin in CIELAB (H, W) of each pixel of an image (H, W, 3) BGR; finer in tint than in lightness."""
    import cv2

    number = np.zeros(image.shape[:2], np.int32)
    lab = cv2.cvtColor(np.rint(image).astype(np.uint8), cv2.COLOR_BGR2LAB)
    for channel, count in zip(cv2.split(lab), BINS, strict=True):
        number = number * count + channel.astype(np.int32) * count // 256
    return number


def _density(bins: I32) -> F64:
    """Return how common each colour is among pixels (N,)."""
    from scipy.ndimage import gaussian_filter

    counts = np.bincount(bins, minlength=int(np.prod(BINS))).astype(np.float64).reshape(BINS)
    return gaussian_filter(counts, SMOOTH).ravel() / max(len(bins), 1)


def every(channels: Bool) -> Bool:
    """Return where (H, W) all three channels hold; `all(axis=2)` takes more than ten times as long."""
    b, g, r = np.moveaxis(channels, 2, 0)
    found: Bool = b & g & r
    return found
