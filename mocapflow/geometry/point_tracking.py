"""Points tracked from one grey picture into another by pyramids of Lucas-Kanade steps, there and back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.records import F32, U8, Bool


class LucasKanade(NamedTuple):
    """How points are tracked."""

    window_px: int  # edge of the square that is compared
    levels: int  # of the pyramid: each doubles the motion that can be followed
    most: int  # steps a level
    rest_px: float  # a point is found when it moves by less in a step
    round_trip_px: float  # how near a point has to come to where it was


def track_points(old: U8, new: U8, points: F32, steps: LucasKanade) -> tuple[F32, Bool]:
    """Return where points (N, 2) px of a grey picture (H, W) are in another, and which come back from there."""
    there, found = _step(old, new, points, steps)
    back, refound = _step(new, old, there, steps)
    return there, found & refound & (np.linalg.norm(back - points, axis=1) < steps.round_trip_px)


def _step(old: U8, new: U8, points: F32, steps: LucasKanade) -> tuple[F32, Bool]:
    import cv2

    window = (steps.window_px, steps.window_px)
    rest = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, steps.most, steps.rest_px)
    to, found, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
        old, new, points, None, winSize=window, maxLevel=steps.levels, criteria=rest
    )
    return np.asarray(to, np.float32), np.asarray(found, bool).ravel()
