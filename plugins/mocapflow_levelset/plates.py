"""The empty scene as a density: how well the plate, lit or in a shadow, explains a pixel.

In CIELAB a neutral shadow scales (L + 16, a, b) by one factor k < 1, because all three are cube roots of
intensities. So a pixel is the background in shadow where it lies on the ray from black to the plate's colour:
a darker version with the same chromaticity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F32
from mocapflow_levelset.channels import ChannelName, features

BLACK = (-16 / 100, 128 / 255, 128 / 255)  # where the rays start, in lab channels scaled to [0, 1]
BENDING = 0.05  # how far a shadow may be off the ray, as a share of the colour's distance from grey


class Plate(NamedTuple):
    """The empty scene on the grid of an image."""

    features: F32  # (C, H, W) in [0, 1], the mean
    spread: F32  # (H, W) standard deviation of every channel, in units of the channels


class Shadow(NamedTuple):
    """What counts as background in a shadow, and how surprising a pixel may be."""

    share: float  # prior share of shadow on the background; 0 switches the suppression off
    darkest: float  # smallest factor k of (L + 16, a, b)
    chroma: float  # standard deviation of the distance to the ray, as a share of the range
    log_stranger: float  # log density below which neither region calls a pixel more unlikely
    lab: int  # index of the first lab channel, -1 without


def plate_from(mean: F32, spread: F32, channels: Sequence[ChannelName], floor: float) -> Plate:
    """Return the plate of one view from its mean and spread, both (H, W, 3) grey levels.

    The spread in each channel is taken as the root mean square over the colours, at least `floor` of the range.
    """
    grey = np.clip(np.rint(mean), 0, 255).astype(np.uint8)
    levels = np.sqrt(np.einsum("ijk,ijk->ij", spread, spread) / 3)
    return Plate(features(grey, channels), np.maximum(levels / 255, floor).astype(np.float32))


def first_lab(channels: Sequence[ChannelName]) -> int:
    """Return the index of the first lab plane among the feature planes, -1 without."""
    widths = {"grey": 1, "lab": 3, "texture": 3}
    if "lab" not in channels:
        return -1
    return sum(widths[name] for name in channels[: list(channels).index("lab")])


def log_density(image: F32, plate: Plate, shadow: Shadow) -> F32:
    """Return the log density (H, W) of each pixel's features (C, H, W) under the plate, lit or shadowed."""
    out = np.empty(image.shape[1:], np.float32)
    for y in range(image.shape[1]):
        _log_density_row(image[:, y], plate.features[:, y], plate.spread[y], tuple(map(np.float32, shadow)), out[y])
    return out


@numba.njit(cache=True)
def _log_density_row(image, plate, spread, shadow, out):  # type: ignore[no-untyped-def]
    for x in range(out.size):
        out[x] = plate_density(image, plate, spread[x], shadow, x)


@numba.njit(cache=True)
def plate_density(image, plate, spread, shadow, x):  # type: ignore[no-untyped-def]
    """Return the log density of pixel x of a row (C, W) under the plate, lit or shadowed."""
    share, darkest, chroma, stranger, lab = shadow
    first, two = int(lab), np.float32(2)
    inverse = np.float32(0.5) / (spread * spread)
    norm = np.float32(-0.9189385) - np.log(spread)
    others, lit = np.float32(0), np.float32(0)
    for c in range(image.shape[0]):
        off = image[c, x] - plate[c, x]
        if 0 <= first <= c < first + 3:
            lit += norm - off * off * inverse
        else:
            others += norm - off * off * inverse
    if first < 0 or share <= 0:
        return max(lit + others, stranger)
    light, green, blue = (
        plate[first, x] - np.float32(BLACK[0]),
        plate[first + 1, x] - np.float32(BLACK[1]),
        plate[first + 2, x] - np.float32(BLACK[2]),
    )
    here, a, b = (
        image[first, x] - np.float32(BLACK[0]),
        image[first + 1, x] - np.float32(BLACK[1]),
        image[first + 2, x] - np.float32(BLACK[2]),
    )
    square = light * light + green * green + blue * blue
    k = (here * light + a * green + b * blue) / square
    bound = min(max(k, darkest), np.float32(1))
    over = k - bound
    r0, r1, r2 = here - k * light, a - k * green, b - k * blue
    # the stronger a colour, the more the colours of lamp and room bend its ray
    across = chroma * chroma + np.float32(BENDING * BENDING) * (green * green + blue * blue)
    off_ray = (r0 * r0 + r1 * r1 + r2 * r2) / across + over * over * square * two * inverse
    # uniform along the ray between the darkest shadow and full light, Gaussian across it
    along = np.log(share / ((np.float32(1) - darkest) * np.sqrt(square)))
    dark = along + two * np.float32(-0.9189385) - np.log(across) - np.float32(0.5) * off_ray
    return max(max(lit, dark) + others, stranger)
