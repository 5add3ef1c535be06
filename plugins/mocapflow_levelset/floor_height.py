"""The height of the floor: where views of the person's shadow agree about it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame, Surface
from mocapflow.records import F64
from mocapflow_levelset.floor_light import small_views
from mocapflow_levelset.plates import BLACK, plate_in
from mocapflow_levelset.shadow_consistency import agreement
from mocapflow_levelset.shadows import floor_around

BELOW_M, ABOVE_M = 0.6, 0.15  # the lowest point of a body, which may be in a jump or stand on thick soles
COARSE_M, FINE_M = 0.04, 0.01
ROWS = 200  # of a view, about
DARK = 0.95  # of the light: less is in a shadow
LEAST = 300  # agreeing pixels in all frames; fewer can be chance
DISTINCT = 1.5  # times the median agreement over all heights
GREY = 0.03  # of the range: chroma of a floor below which grey clothes pass for its shadow; boards have 0.06 and more


def floor_height(
    frames: Iterable[Frame], background: Background, cameras: Sequence[Camera], feet_m: float
) -> float | None:
    """Return the height (m) of the floor at which views agree most about shadows, None where they don't agree.

    Args:
        frames: some moments.
        background: the empty scene.
        cameras: all of them.
        feet_m: height of the lowest point of the person.
    """
    moments = [small_views(frame, background, cameras, ROWS) for frame in frames]

    def agree(height_m: float) -> int:
        return sum(agreement(views, height_m, DARK) for views in moments)

    coarse = np.arange(feet_m - BELOW_M, feet_m + ABOVE_M, COARSE_M)
    found, most, usual = _best(agree, coarse)
    if most < max(LEAST, DISTINCT * usual):
        return None
    return _best(agree, np.arange(found - COARSE_M, found + COARSE_M, FINE_M))[0]


def grey_floor(background: Background, cameras: Sequence[Camera], body: Surface) -> bool:
    """Return whether the floor around a body has hardly a colour, in most views."""
    chromas = []
    for number, camera in enumerate(cameras):
        floor = floor_around(body, camera) & background.known[number]
        _, a, b = plate_in(background, number, ("lab",)).planes[:, floor] - np.array(BLACK, np.float32)[:, None]
        chromas.append(float(np.median(np.hypot(a, b))) if len(a) else np.inf)
    return float(np.median(chromas)) < GREY


def _best(agree: Callable[[float], int], heights: F64) -> tuple[float, int, float]:
    """Return the height with the most agreement, that, and the median agreement."""
    counts = [agree(height) for height in heights.tolist()]
    return float(heights[np.argmax(counts)]), max(counts), float(np.median(counts))
