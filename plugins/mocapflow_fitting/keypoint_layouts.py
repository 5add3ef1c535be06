"""Which keypoint is which: the orders in which pose estimators list the points of a person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.records import F64, I32

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

MIDWAY = ((8, 9, 12, 0.03), (1, 2, 5, 0.05))  # of BODY_25: hips, shoulders; off by a share of the person's size


def layout_of(detections: list[F64], wanted: Layout | None = None) -> Layout | None:
    """Return the layout of detections, each (K, 3) px, px, confidence; None: too little is seen to tell two apart.

    BODY_25 and BODY_25B both have 25 points: in the first, point 8 lies midway between points 9 and 12, the hips, and
    point 1 between points 2 and 5, the shoulders.

    Raises:
        RecordingError: no layout has that many points, or not the one that is wanted.
    """
    counts = {len(points) for points in detections}
    if wanted is not None:
        if strange := counts - {len(LAYOUTS[wanted])}:
            what = f"a person has {min(strange)} keypoints, in the layout {wanted} {len(LAYOUTS[wanted])}"
            raise RecordingError(what, hint="set another `layout`, or none: their number tells it")
        return wanted
    if counts == {25}:
        return _of_25(np.stack(detections))
    for name, points in LAYOUTS.items():
        if counts == {len(points)}:
            return name
    known = ", ".join(f"{name} ({len(points)})" for name, points in LAYOUTS.items())
    what = f"detections with {', '.join(map(str, sorted(counts)))} keypoints" if counts else "no detections"
    raise RecordingError(f"{what}: the layout of the keypoints is not known", hint=f"known layouts: {known}")


def rows_of(listed: Sequence[str], wanted: Sequence[str]) -> I32:
    """Return where each wanted name stands in a list, -1 where it does not."""
    return np.array([listed.index(name) if name in listed else -1 for name in wanted], np.int32)


def _of_25(points: F64) -> Layout | None:
    """Return the layout of detections (N, 25, 3), by a point that in BODY_25 lies midway between two others."""
    for middle, one, other, share in MIDWAY:
        known = points[(points[:, [middle, one, other], 2] > 0).all(axis=1)]
        if len(known):
            size = [np.ptp(person[person[:, 2] > 0, :2], axis=0).max() for person in known]
            off = known[:, middle, :2] - (known[:, one, :2] + known[:, other, :2]) / 2
            return "body_25" if np.median(np.linalg.norm(off, axis=1) / size) < share else "body_25b"
    return None
