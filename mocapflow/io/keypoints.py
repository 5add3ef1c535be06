"""OpenPose-format 2D keypoints: one JSON file per camera and frame."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.video import numbered
from mocapflow.records import F64


def keypoint_files(folder: Path) -> dict[int, Path]:
    """Return the files of one camera's folder by frame number."""
    return numbered(folder, (".json",))


def read_keypoints(path: Path) -> F64:
    """Return the keypoints (N people, K, 3) of a file: px, px, confidence, as the file has them.

    Nobody in the picture gives (0, 0, 3).

    Raises:
        RecordingError: the file is not in OpenPose's format.
    """
    try:
        people = json.loads(path.read_text(encoding="utf-8"))["people"]
        rows = [np.array(person["pose_keypoints_2d"], np.float64).reshape(-1, 3) for person in people]
        return np.stack(rows) if rows else np.empty((0, 0, 3))
    except (ValueError, TypeError, KeyError) as error:
        raise RecordingError(
            f"not a file of keypoints: {error}",
            where=str(path),
            hint='expected OpenPose\'s format: {"people": [{"pose_keypoints_2d": [x, y, confidence, ...]}]}',
        ) from error


def unseen(keypoints: F64) -> F64:
    """Return keypoints where every point with a number missing is at (0, 0) with confidence 0."""
    lost = ~np.isfinite(keypoints).all(axis=-1, keepdims=True)
    return np.where(lost, 0.0, keypoints)
