"""What an image says: features for the statistics on a sparse grid, features along runs for the contour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.records import F32, I32, U8, Bool
from mocapflow_levelset.channels import LAG_PX, ChannelName, decorrelation, features
from mocapflow_levelset.crops import Crop
from mocapflow_levelset.plates import Plate, Shadow, density_of

POINTWISE = ("grey", "lab", "chromaticity")  # channels that depend on one pixel only


class Evidence(NamedTuple):
    """An image as the descent sees it."""

    sparse: F32  # (C, h, w) in [0, 1], every `stride`-th pixel, for the statistics
    weight: F32  # (H, W) 1 where a pixel counts, 0 where it is masked
    stride: int
    along: Callable[[I32], F32]  # features (C, N) of the N pixels of some runs
    outside: Callable[[I32, F32], F32] | None = None  # log density (N,) in the empty scene of runs and features, or NaN
    colour_ratio: F32 | None = None  # (H, W) log ratio of person and room by learned colours, beside the statistics


class Room(NamedTuple):
    """The empty room in one view at one size, and how pixels are compared with it."""

    plate: Plate
    floor: Bool  # (H, W) True where a shadow may fall
    shadow: Shadow
    smooth_px: float = 0.0  # smoothing of the image before

    def of(self, crop: Crop) -> Room:
        """Return a rectangle of it."""
        return self._replace(plate=self.plate.of(crop), floor=crop.of(self.floor))


def from_image(
    image: U8, weight: F32, channels: Sequence[ChannelName], stride: int, decorrelate: bool = False
) -> Evidence:
    """Return the evidence of a BGR image (H, W, 3) whose pixels count by their weight (H, W).

    Channels that depend on one pixel only are computed for the pixels that need them. Decorrelated, the channels
    are turned to the image's own principal axes, so that treating them as independent is right.
    """
    if all(name in POINTWISE for name in channels):
        sparse = features(_sparse(image, stride), channels)

        def along(runs: I32) -> F32:
            return features(gather(image, runs)[None], channels)[:, 0]
    else:
        planes = features(np.ascontiguousarray(image), channels)
        sparse = np.ascontiguousarray(planes[:, ::stride, ::stride])

        def along(runs: I32) -> F32:
            return gather_planes(planes, runs)

    if decorrelate and len(sparse) > 1 and sparse.shape[2] > LAG_PX:
        axes = decorrelation(sparse)
        turned = np.einsum("ij,jyx->iyx", axes, sparse)
        return Evidence(turned, weight, stride, lambda runs: np.ascontiguousarray(axes @ along(runs)))
    return Evidence(sparse, weight, stride, along)


def in_room(evidence: Evidence, image: U8, channels: Sequence[ChannelName], room: Room) -> Evidence:
    """Return the evidence of an image whose outside is the empty room; its channels have to be as they are."""
    smooth = smoothed(image, room.smooth_px)

    def outside(runs: I32, values: F32) -> F32:
        if smooth is not image:
            values = features(gather(smooth, runs)[None], channels)[:, 0]
        expected, spread = gather_planes(room.plate.planes, runs), gather_planes(room.plate.spread[None], runs)[0]
        shaded = gather_planes(room.floor[None], runs)[0] > 0
        return density_of(values, expected, spread, shaded, channels, room.shadow)

    return evidence._replace(outside=outside)


def smoothed(image: U8, smooth_px: float) -> U8:
    """Return an image (H, W, 3) less its noise, so that the colour of a shadow can be told from that of the plate."""
    import cv2

    return np.asarray(cv2.GaussianBlur(image, (0, 0), smooth_px), np.uint8) if smooth_px > 0.3 else image


def gather(image: U8, runs: I32) -> U8:
    """Return the pixels (N, 3) of an image (H, W, 3) along runs, rows of (y, first x, last x + 1)."""
    pixels: U8 = _gather(image, runs, np.empty((int((runs[:, 2] - runs[:, 1]).sum()), 3), np.uint8))
    return pixels


def gather_planes(planes: F32 | Bool, runs: I32) -> F32:
    """Return the pixels (C, N) of planes (C, H, W) along runs."""
    pixels: F32 = _gather_planes(planes, runs, int((runs[:, 2] - runs[:, 1]).sum()))
    return pixels


@numba.njit(cache=True)
def _sparse(image, stride):  # type: ignore[no-untyped-def]
    """Return every stride-th pixel of an image (H, W, 3): five times as fast as a copy of the slice."""
    height, width = (image.shape[0] - 1) // stride + 1, (image.shape[1] - 1) // stride + 1
    out = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            for c in range(3):
                out[y, x, c] = image[y * stride, x * stride, c]
    return out


@numba.njit(cache=True, error_model="numpy")
def _gather(image, runs, out):  # type: ignore[no-untyped-def]
    n = 0
    for y, first, last in runs:
        for x in range(first, last):
            out[n, 0], out[n, 1], out[n, 2] = image[y, x, 0], image[y, x, 1], image[y, x, 2]
            n += 1
    return out


@numba.njit(cache=True, error_model="numpy")
def _gather_planes(planes, runs, total):  # type: ignore[no-untyped-def]
    out = np.empty((planes.shape[0], total), np.float32)
    for c in range(planes.shape[0]):
        n = 0
        for k in range(len(runs)):
            y, first, last = runs[k, 0], runs[k, 1], runs[k, 2]
            out[c, n : n + last - first] = planes[c, y, first:last]
            n += last - first
    return out
