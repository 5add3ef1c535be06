"""Shadows on the floor look the same from everywhere: what the other views of the floor contradict is no shadow.

A matt floor sends as much of a shadow's light to one camera as to another. So a grey sock before a grey floor, which in
one view can't be told from a shadow, is told by another that sees the floor behind it lit, or two that see it darker.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import Frame
from mocapflow.memo import memoised
from mocapflow.records import F32, F64, I32, Bool
from mocapflow_levelset.floor_light import SmallView, small_views

REACH = 2  # px to either side, within which views have to see the same
LIT = 0.98  # of the light: more is no shadow, whatever it is
TOLERANCE = 0.025  # of the light
SOLID = np.ones((3, 3), np.uint8)  # thinner things are edges, whose pixels mix person and floor


def contradicted(views: Sequence[SmallView], floor_m: float) -> list[Bool]:
    """Return for each view where (h, w) others tell that its pixels do not show the floor.

    Two others agree about the light there, or one sees the floor fully lit; and none sees the light of this view.

    Args:
        views: small views of one moment.
        floor_m: height of the floor.
    """
    import cv2

    found = []
    for view in views:
        against = np.zeros(view.light.shape, np.uint8)
        places = np.argwhere(view.light < LIT).astype(np.int32)
        seen = [_seen(other, view.camera, places, floor_m) for other in views if other is not view]
        if len(seen) > 1:
            row, column = places.T
            against[row, column] = _alone(view.light[row, column], np.stack(seen), np.float32(TOLERANCE))
        found.append(cv2.morphologyEx(against, cv2.MORPH_OPEN, SOLID).astype(bool))
    return found


def agreement(views: Sequence[SmallView], floor_m: float, dark: float) -> int:
    """Return how many pixels in a shadow agree with other views, counted once for each of these.

    Args:
        views: small views of one moment.
        floor_m: height of the floor, as supposed.
        dark: what has less light is in a shadow.
    """
    count = 0
    for number, view in enumerate(views):
        shadow = view.light < dark
        for k in range(len(views)):
            if k != number:
                there = _onto(views[k].light, views[k].camera, view.camera, floor_m)
                count += int(np.count_nonzero((np.abs(view.light - there) < TOLERANCE) & shadow))
    return count


@memoised
def no_shadows(frame: Frame, background: Background, cameras: tuple[Camera, ...]) -> tuple[Bool, ...] | None:
    """Return where (H, W) each view shows something else than the floor; None: it is not known where the floor is."""
    if background.floor_m is None or np.count_nonzero(frame.usable) < 3:
        return None
    views = small_views(frame, background, cameras)
    masks = contradicted(views, background.floor_m)
    return tuple(_enlarged(mask, view.factor, c) for mask, view, c in zip(masks, views, cameras, strict=True))


def _seen(other: SmallView, camera: Camera, places: I32, floor_m: float) -> F32:
    """Return the least and the greatest light (N, 2) that another view sees near places of the floor.

    NaN where it shows something else there, or does not see the place.

    Args:
        other: the view from which they are looked at.
        camera: of the view that the places are given in.
        places: (N, 2) rows and columns in that.
        floor_m: height of the floor.
    """
    way = _of_floor(other.camera, floor_m) @ np.linalg.inv(_of_floor(camera, floor_m))
    out = np.full((len(places), 2), np.nan, np.float32)
    _look(other.light, way, places, out)
    return out


def _onto(light: F32, source: Camera, target: Camera, floor_m: float) -> F32:
    """Return what one camera sees (h, w) of the floor, as another camera sees the floor; NaN beyond its picture."""
    import cv2

    way, size = _of_floor(target, floor_m) @ np.linalg.inv(_of_floor(source, floor_m)), target.size.tolist()
    nowhere = (np.nan,) * 4
    return np.asarray(cv2.warpPerspective(light, way, size, None, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT, nowhere))


def _of_floor(camera: Camera, floor_m: float) -> F64:
    """Return the homography (3, 3) from places x, y m on the floor to pixels."""
    matrix = camera.intrinsics @ camera.camera_from_world[:3]
    return np.column_stack([matrix[:, 0], matrix[:, 1], matrix[:, 2] * floor_m + matrix[:, 3]])


def _enlarged(mask: Bool, factor: int, camera: Camera) -> Bool:
    """Return a mask (h, w) at full size (H, W); what was left over at the rim is False."""
    import cv2

    whole = np.zeros(camera.size[::-1], bool)
    height, width = mask.shape[0] * factor, mask.shape[1] * factor
    large = cv2.resize(mask.view(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    whole[:height, :width] = large.view(bool)
    return whole


@numba.njit(cache=True, error_model="numpy")
def _look(light, way, places, out):  # type: ignore[no-untyped-def]
    height, width = light.shape
    for n in range(len(places)):
        row, column = places[n]
        depth = way[2, 0] * column + way[2, 1] * row + way[2, 2]
        x = round((way[0, 0] * column + way[0, 1] * row + way[0, 2]) / depth)
        y = round((way[1, 0] * column + way[1, 1] * row + way[1, 2]) / depth)
        if not (REACH <= x < width - REACH and REACH <= y < height - REACH):
            continue
        low, high, known = np.float32(np.inf), np.float32(-np.inf), True
        for j in range(y - REACH, y + REACH + 1):
            for i in range(x - REACH, x + REACH + 1):
                known &= light[j, i] > 0  # not NaN
                low, high = min(low, light[j, i]), max(high, light[j, i])
        if known:
            out[n, 0], out[n, 1] = low, high


@numba.njit(cache=True, error_model="numpy")
def _alone(light, seen, tolerance):  # type: ignore[no-untyped-def]
    """Return 1 where one view (V, N, 2) sees the floor lit or two agree, and none sees this one's light (N,)."""
    out = np.zeros(len(light), np.uint8)
    for n in range(len(light)):
        alone, agree = True, False
        for j in range(len(seen)):
            low, high = seen[j, n]
            if low - tolerance < light[n] < high + tolerance:
                alone = False
            agree |= low > 1 - tolerance and high < 1 + tolerance
            for k in range(j):
                if seen[k, n, 0] - tolerance < high and low < seen[k, n, 1] + tolerance:
                    agree = True
        out[n] = alone and agree
    return out
