"""OpenPose-format 2D keypoints: one JSON file per camera and frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.images import name_frames, numbered
from mocapflow.io.typed import read_json
from mocapflow.records import F64

FORM = 'expected OpenPose\'s format: {"people": [{"pose_keypoints_2d": [x, y, confidence, ...]}]}'


def keypoint_files(folder: Path, first: int = 0) -> dict[int, Path]:
    """Return the files of one camera's folder by frame number.

    Args:
        folder: of one camera.
        first: number of frame 0's image, which files that are named after images count from, too.

    Raises:
        RecordingError: two files have one number.
    """
    files = numbered(folder, (".json",))
    begin = first if files and min(files) >= first else 0
    return {number - begin: path for number, path in files.items()}


def read_keypoints(path: Path) -> F64:
    """Return the keypoints (N people, K, 3) of a file: px, px, confidence, as the file has them.

    Nobody in the picture gives (0, 0, 3).

    Raises:
        RecordingError: the file is not in OpenPose's format.
    """
    content = read_json(path, FORM)
    try:
        rows = [np.array(person["pose_keypoints_2d"], np.float64).reshape(-1, 3) for person in content["people"]]
        return np.stack(rows) if rows else np.empty((0, 0, 3))
    except (ValueError, TypeError, KeyError) as error:
        raise RecordingError(f"not a file of keypoints: {error}", where=str(path), hint=FORM) from error


def people_at(files: Mapping[int, Path] | None, index: int) -> F64:
    """Return the people (N, K, 3) of a frame; nobody where its file is missing or can't be read (see `odd_keypoints`).

    A point with a number missing is at (0, 0) with confidence 0.
    """
    if files is None or index not in files:
        return np.empty((0, 0, 3))
    try:
        people = read_keypoints(files[index])
    except RecordingError:
        return np.empty((0, 0, 3))
    lost = ~np.isfinite(people).all(axis=-1, keepdims=True)
    return np.where(lost, 0.0, people)


def odd_keypoints(camera: str, folder: Path, length: int, first: int = 0) -> list[str]:
    """Say what is odd about the keypoints of a camera with `length` frames; every file is read (60 us each)."""
    files = keypoint_files(folder, first)
    broken, gaps, counts, farthest = [], [], set(), 0.0
    for index, path in files.items():
        try:
            people = read_keypoints(path)
        except RecordingError:
            broken.append(index)
            continue
        counts |= {people.shape[1]} if len(people) else set()
        gaps += [index] if not np.isfinite(people).all() else []
        farthest = max(farthest, float(np.nanmax(np.abs(people[..., :2]), initial=0.0)))
    beyond, missing = [i for i in files if i >= length], [i for i in range(length) if i not in files]
    faults = (
        (broken, "can't be read: nobody is seen there"),
        (gaps, "are not all numbers (NaN): these points count as not seen"),
        (beyond, f"lie after the last frame, {length - 1}: they are left out"),
        (missing, "are missing: nobody is seen there"),
    )
    odd = [f"{camera}: keypoints of {name_frames(indices)} {what}" for indices, what in faults if indices]
    if len(counts) > 1:
        odd.append(f"{camera}: people with {' and with '.join(map(str, sorted(counts)))} keypoints in one folder")
    if 0 < farthest <= 1:
        odd.append(f"{camera}: all keypoints lie within one pixel: are they shares of the picture? expected pixels")
    return odd
