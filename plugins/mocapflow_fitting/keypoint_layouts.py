"""Which keypoint is which: the orders in which pose estimators list the points of a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.records import F64

Layout = Literal["body_25", "body_25b", "halpe_26", "coco_17"]
FACE = ("nose", "eye_l", "eye_r", "ear_l", "ear_r")
PAIRS = tuple(f"{name}_{side}" for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in "lr")
RIGHT_LEG, LEFT_LEG = (tuple(f"{name}_{side}" for name in ("hip", "knee", "ankle")) for side in "rl")
RIGHT_ARM, LEFT_ARM = (tuple(f"{name}_{side}" for name in ("shoulder", "elbow", "wrist")) for side in "rl")
LEFT_FOOT, RIGHT_FOOT = (tuple(f"{name}_{side}" for name in ("big_toe", "small_toe", "heel")) for side in "lr")

LAYOUTS: Mapping[Layout, tuple[str, ...]] = {
    "body_25": (
        "nose", "neck", *RIGHT_ARM, *LEFT_ARM, "hip_mid", *RIGHT_LEG, *LEFT_LEG,
        "eye_r", "eye_l", "ear_r", "ear_l", *LEFT_FOOT, *RIGHT_FOOT,
    ),
    "body_25b": (*FACE, *PAIRS, "neck", "head_top", *LEFT_FOOT, *RIGHT_FOOT),
    "halpe_26": (
        *FACE, *PAIRS, "head_top", "neck", "hip_mid",
        "big_toe_l", "big_toe_r", "small_toe_l", "small_toe_r", "heel_l", "heel_r",
    ),
    "coco_17": (*FACE, *PAIRS),
}  # fmt: skip


def layout_of(detections: list[F64]) -> Layout:
    """Return the layout of detections, each (K, 3) px, px, confidence.

    BODY_25 and BODY_25B both have 25 points: in the first, point 8 lies midway between points 9 and 12, the hips.

    Raises:
        RecordingError: no layout has that many points.
    """
    counts = {len(points) for points in detections}
    if counts == {25}:
        return "body_25" if _has_mid_hip(np.stack(detections)) else "body_25b"
    for name, points in LAYOUTS.items():
        if counts == {len(points)}:
            return name
    known = ", ".join(f"{name} ({len(points)})" for name, points in LAYOUTS.items())
    what = f"detections with {', '.join(map(str, sorted(counts)))} keypoints" if counts else "no detections"
    raise RecordingError(f"{what}: the layout of the keypoints is not known", hint=f"known layouts: {known}")


def _has_mid_hip(points: F64) -> bool:
    seen = points[(points[:, [1, 8, 9, 12], 2] > 0).all(axis=1)][..., :2]
    if not len(seen):
        return False
    off = np.linalg.norm(seen[:, 8] - (seen[:, 9] + seen[:, 12]) / 2, axis=1)
    return bool(np.median(off / np.linalg.norm(seen[:, 8] - seen[:, 1], axis=1)) < 0.1)
