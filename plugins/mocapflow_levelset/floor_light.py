"""How much light reaches what each view shows, were it the floor: what is darker may lie in a shadow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame
from mocapflow.geometry.cameras import shrunk
from mocapflow.records import F32, U8
from mocapflow_levelset import crops
from mocapflow_levelset.channels import ChannelName, features
from mocapflow_levelset.evidence import smoothed
from mocapflow_levelset.plates import USUAL, Plate, on_ray, plate_in

CHANNELS: tuple[ChannelName, ...] = ("lab",)
ROWS = 400  # about so many of a view are compared
SMOOTH_PX = 1.0
OFF = 3.5  # standard deviations off the ray of its shadows up to which a pixel may be the floor's
BRIGHTER = 1.06  # than the empty scene: more is no floor


class SmallView(NamedTuple):
    """A view, shrunk, and the share of its light that reaches the floor."""

    camera: Camera
    factor: int
    light: F32  # (h, w) NaN where it does not look like the floor


def small_views(frame: Frame, background: Background, cameras: Sequence[Camera], rows: int = ROWS) -> list[SmallView]:
    """Return how much light reaches what each usable view of a frame shows, were it the floor; others show nothing."""
    found = []
    for number, camera in enumerate(cameras):
        factor = max(round(camera.size[1] / rows), 1)
        small = shrunk(camera, factor)
        light = np.full(small.size[::-1], np.nan, np.float32)
        if frame.usable[number]:
            plate = plate_in(background, number, CHANNELS, factor)
            light = light_on(crops.shrink(frame.images[number], factor), plate)
            if (hidden := frame.hidden_in(number)) is not None:
                light[crops.shrink_mask(hidden, factor)] = np.nan
        found.append(SmallView(small, factor, light))
    return found


def light_on(image: U8, plate: Plate) -> F32:
    """Return the factor (h, w) by which an image (h, w, 3) is darker than its plate, NaN where it is something else."""
    values = features(smoothed(image, SMOOTH_PX), CHANNELS)
    flat, expected = values.reshape(len(values), -1), plate.planes.reshape(len(values), -1)
    out = np.empty(flat.shape[1], np.float32)
    limits = tuple(np.float32(limit) for limit in (USUAL.darkest, BRIGHTER, USUAL.chroma, OFF))
    _light(flat, expected, plate.spread.ravel(), limits, out)
    return out.reshape(image.shape[:2])


@numba.njit(cache=True, error_model="numpy")
def _light(values, plate, spread, limits, out):  # type: ignore[no-untyped-def]
    darkest, brightest, chroma, most = limits
    for n in range(out.size):
        light, _, residual, across = on_ray(values, plate, n, 0, chroma)
        floor = residual < most * most * across and darkest < light < brightest
        out[n] = light if floor and np.isfinite(spread[n]) else np.nan
