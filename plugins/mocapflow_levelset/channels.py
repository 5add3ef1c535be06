"""Feature channels of an image: grey, CIELAB, chromaticity and texture, scaled to about [0, 1], held independent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numba
import numpy as np

from mocapflow.records import F32, U8

ChannelName = Literal["grey", "lab", "chromaticity", "texture"]
PLANES = {"grey": 1, "lab": 3, "chromaticity": 3, "texture": 3}
SHADE = 0.12  # of the range, for a factor e of lightness: a contact shadow, a quarter of that, is no more than noise
CHROMATICITY = 1.5  # of the channel's range for a chroma as great as the lightness
TEXTURE_SCALE_PX = 2.0  # smoothing of the structure tensor
LAG_PX = 4  # distance of the pixels whose differences tell how channels vary together


def features(image: U8, channels: Sequence[ChannelName]) -> F32:
    """Return the channels of a BGR image (H, W, 3) as (C, H, W) in [0, 1].

    Args:
        image: (H, W, 3) BGR grey levels.
        channels: which channels, in order; `PLANES` says how many planes each gives.
    """
    import cv2

    parts: list[F32] = []
    for name in channels:
        if name == "grey":
            parts.append(_scaled(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)[..., None]))
        elif name == "lab":
            parts.append(_scaled(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), np.uint8)))
        elif name == "chromaticity":
            parts.append(_chromaticity(image))
        else:
            parts.append(_texture(image))
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def decorrelation(planes: F32) -> F32:
    """Return a rotation (C, C) that makes channels (C, H, W) independent within a texture.

    Its rows are the principal axes of the differences between pixels a little apart, which a slow drift of
    colour over the image and the few pixels at its edges hardly enter.
    """
    apart = (planes[:, :, LAG_PX:] - planes[:, :, :-LAG_PX]).reshape(len(planes), -1)
    _, axes = np.linalg.eigh(apart @ apart.T)
    return np.ascontiguousarray(axes.T, np.float32)


def _scaled(levels: U8) -> F32:
    """Return interleaved grey levels (H, W, C) as separate planes (C, H, W) in [0, 1]."""
    planes = np.empty((levels.shape[2], *levels.shape[:2]), np.float32)
    _separate(levels, planes)
    return planes


@numba.njit(cache=True)
def _separate(levels, planes):  # type: ignore[no-untyped-def]
    for row in range(levels.shape[0]):
        for c in range(planes.shape[0]):
            line, mixed = planes[c, row], levels[row, :, c]
            for x in range(line.size):
                line[x] = np.float32(mixed[x]) * np.float32(1 / 255)


def _chromaticity(image: U8) -> F32:
    """Return log lightness, on so small a scale that shading hardly counts, and the two chromaticities.

    A shadow scales (L + 16, a, b) by one factor, which leaves a / (L + 16) and b / (L + 16) as they are.
    """
    import cv2

    lab = cv2.cvtColor(image.astype(np.float32) / np.float32(255), cv2.COLOR_BGR2LAB)
    light = lab[..., 0] + np.float32(16)
    planes = np.stack([SHADE * np.log(light / 116) + 1, *(0.5 + CHROMATICITY * lab[..., k] / light for k in (1, 2))])
    return np.asarray(planes, np.float32)


def _texture(image: U8) -> F32:
    """Return the square root of the smoothed structure tensor, summed over colour: |Ix|, |Iy| and signed Ix Iy."""
    import cv2

    colour = image.astype(np.float32) / np.float32(255)
    dx, dy = cv2.Sobel(colour, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(colour, cv2.CV_32F, 0, 1, scale=0.125)
    tensor = np.stack([(dx * dx).sum(axis=2), (dy * dy).sum(axis=2), (dx * dy).sum(axis=2)])
    smooth = np.stack([cv2.GaussianBlur(entry, (0, 0), TEXTURE_SCALE_PX) for entry in tensor])
    # roots make the entries amplitudes, so that they are comparable with grey levels; 2 fills the range
    roots = np.sign(smooth) * np.sqrt(np.abs(smooth)) * 2
    roots[2] = 0.5 + 0.5 * roots[2]
    texture: F32 = np.clip(roots, 0, 1).astype(np.float32)
    return texture
