"""Where a picture shows people, by their 2D keypoints."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mocapflow_fitting.keypoint_layouts import LAYOUTS, layout_of

from mocapflow.errors import RecordingError
from mocapflow.geometry.silhouettes import distance_to
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, Bool

LOG = logging.getLogger("mocapflow")
REACH = 0.04  # of the diagonal of a person's keypoints, 7 cm of somebody who stands: flesh, and errors of keypoints
PARTS = (  # of a person: the convex hull of each is filled
    ("head_top", "nose", "ear_l", "ear_r", "shoulder_l", "shoulder_r"),
    ("shoulder_l", "shoulder_r", "hip_l", "hip_r"),
    ("hip_l", "hip_r", "knee_l", "knee_r"),  # a skirt between the legs, too
    *((f"shoulder_{side}", f"elbow_{side}", f"wrist_{side}") for side in "lr"),
    *((f"knee_{side}", f"ankle_{side}", f"heel_{side}", f"big_toe_{side}", f"small_toe_{side}") for side in "lr"),
)


class People(NamedTuple):
    """The people in the pictures of one camera."""

    recording: Recording
    camera: int
    names: tuple[str, ...]  # of the keypoints; empty: there are none

    def beside(self, index: int, shape: tuple[int, ...]) -> Bool:
        """Return where (H, W) a picture of a shape (H, W, 3) shows nobody, as far as keypoints tell."""
        everywhere = np.ones(shape[:2], bool)
        if not self.names:
            return everywhere
        for points in self.recording.people(index)[self.camera]:
            everywhere &= ~near(points, self.names, shape)
        return everywhere


def people_seen(recording: Recording, camera: int, among: Sequence[int]) -> People:
    """Return the people in the pictures of a camera; nobody where it has no keypoints, or of an unknown layout.

    Args:
        recording: with keypoints or without.
        camera: one of its cameras.
        among: numbers of some frames, which tell the layout.
    """
    detections = [points for index in among for points in recording.people(index)[camera]]
    try:
        layout = layout_of(detections) if detections else None
    except RecordingError as error:
        LOG.warning("keypoints do not tell where people are while the empty room is learnt: %s", error)
        layout = None
    return People(recording, camera, LAYOUTS[layout] if layout else ())


def near(points: F64, names: Sequence[str], shape: tuple[int, ...]) -> Bool:
    """Return where (H, W) a person's keypoints (K, 3) px, px, confidence, are near."""
    import cv2

    seen = {name: point[:2] for name, point in zip(names, points, strict=True) if point[2] > 0}
    filled = np.zeros(shape[:2], np.uint8)
    if not seen:
        return filled > 0
    largest = 4 * max(shape)  # an int of cv2 holds more, and a part so far away is not in the picture
    for part in PARTS:
        corners = [np.clip(seen[name], -largest, largest) for name in part if name in seen]
        if corners:
            cv2.fillConvexPoly(filled, cv2.convexHull(np.rint(corners).astype(np.int32)), 1)
    if not filled.any():
        return filled > 0
    diagonal = np.linalg.norm(np.ptp(list(seen.values()), axis=0))
    return np.asarray(distance_to(filled > 0) <= REACH * diagonal)
