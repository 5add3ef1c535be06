"""One view: from a start contour to the silhouette, coarse to fine, within a crop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, U8
from mocapflow_levelset import crops
from mocapflow_levelset.channels import ChannelName
from mocapflow_levelset.crops import Crop
from mocapflow_levelset.evidence import from_image
from mocapflow_levelset.evolve import Rhythm, Settled, Weights, settle
from mocapflow_levelset.plates import Shadow
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window


class View(NamedTuple):
    """What is given of one view."""

    image: U8  # (H, W, 3) BGR
    start: F32  # (H, W) px, signed distance to the start contour, positive inside
    prior: F32  # (H, W) px, signed distance to the model's outline
    counted: F32  # (H, W) 1 where a pixel counts
    plate: tuple[F32, F32, F32] | None = None  # the empty scene: mean, spread (H, W, 3), where shadows may fall (H, W)


class Level(NamedTuple):
    """One resolution: the image shrunk by a factor, and how long to stay there."""

    factor: int
    rhythm: Rhythm
    window: Window  # in px of the full image
    use_plate: bool = True  # False: local statistics on both sides even where the empty scene is known


class Method(NamedTuple):
    """How to find a silhouette."""

    channels: Sequence[ChannelName]
    median_px: int
    weights: Weights
    shadow: Shadow
    decorrelate: bool
    calm_px: float  # smoothing of the image before it is compared with the empty scene
    stride: int  # of the pixels the statistics are taken from
    margin_px: int


def find(view: View, levels: Sequence[Level], method: Method, band_px: float) -> Settled:
    """Return the silhouette of one view (H, W) and its energies; everything outside without a start contour."""
    multiple = max(level.factor for level in levels)
    crop = crops.around(view.start, method.margin_px, multiple)
    outside = np.full(view.start.shape, -band_px, np.float32)
    if crop is None:
        return Settled(outside, 0.0, 0.0, 0.0)
    part = _cut(view, crop)
    level = part.start
    for resolution in levels:
        settled = _settle_at(part._replace(start=level), resolution, method)
        level = settled.level
    crop.of(outside)[:] = redistance(level, band_px)
    return settled._replace(level=outside)


def _cut(view: View, crop: Crop) -> View:
    plate = None
    if view.plate is not None:
        mean, spread, floor = view.plate
        plate = crop.of(mean), crop.of(spread), crop.of(floor)
    return View(
        image=crop.of_grey_levels(view.image),
        start=np.ascontiguousarray(crop.of(view.start)),
        prior=np.ascontiguousarray(crop.of(view.prior)),
        counted=np.ascontiguousarray(crop.of(view.counted)),
        plate=plate,
    )


def _settle_at(view: View, level: Level, method: Method) -> Settled:
    """Return the descent at one resolution, its level set back on the full grid."""
    factor = level.factor
    if not level.use_plate:
        view = view._replace(plate=None)
    if factor > 1:
        view = _shrunk(view, factor)
    stride = method.stride if factor == 1 else 1
    image = np.ascontiguousarray(view.image)
    evidence = from_image(
        image,
        view.counted,
        method.channels,
        method.median_px,
        stride,
        view.plate,
        method.shadow,
        method.decorrelate,
        method.calm_px / factor,
    )
    full = level.window
    window = Window(full.rho_px / factor, max(full.cell_px // factor, 1), full.floor)
    settled = settle(view.start, view.prior, evidence, window, method.weights, level.rhythm)
    return settled if factor == 1 else settled._replace(level=crops.enlarge(settled.level, factor))


def _shrunk(view: View, factor: int) -> View:
    plate = view.plate
    if plate is not None:
        mean, spread, floor = plate
        plate = (
            crops.shrink_values(mean, factor),
            crops.shrink_values(spread, factor),
            (crops.shrink_values(floor, factor) > 0.5).astype(np.float32),
        )
    return View(
        image=crops.shrink(view.image, factor),
        start=crops.shrink_values(view.start, factor) / np.float32(factor),
        prior=crops.shrink_values(view.prior, factor) / np.float32(factor),
        counted=(crops.shrink_values(view.counted, factor) > 0.5).astype(np.float32),
        plate=plate,
    )
