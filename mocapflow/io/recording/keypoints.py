"""OpenPose-format 2D keypoints: one JSON file per camera and frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.json_toml import read_json
from mocapflow.io.video.images import name_frames, numbered
from mocapflow.records import F64

SUREST = 2.0  # confidence; OpenPose's go a little beyond 1, per cent and pixels far
NONE = "not a file of keypoints"
MOSTLY = 0.5  # share of the points outside the picture; a tool may guess some for who is half in it
FORM = 'expected OpenPose\'s format: {"people": [{"pose_keypoints_2d": [x, y, confidence, ...]}]}'


def keypoint_files(folder: Path, first: int = 0) -> dict[int, Path]:
    """Return the files of one camera's folder by frame number.

    Args:
        folder: of one camera.
        first: number of frame 0's file, see `first_numbers`.

    Raises:
        RecordingError: two files have one number.
    """
    return {number - first: path for number, path in numbered(folder, (".json",)).items()}


def first_numbers(folders: Sequence[Path | None], image: int, length: int) -> list[int]:
    """Return the number of frame 0's file in each folder: that of its image, which it may be named after, or 0.

    A number below that of the first image, or beyond the last frame, tells. For a camera without one the others tell;
    where they don't, or contradict each other, files that end with the last frame count from 0.

    Args:
        folders: of all cameras; None: one without keypoints.
        image: number of frame 0's image.
        length: frames of the videos.

    Raises:
        RecordingError: two files of a camera have one number.
    """
    if not image:
        return [0] * len(folders)
    files = [[] if folder is None else list(numbered(folder, (".json",))) for folder in folders]
    told = [_own_first_number(numbers, image, length) for numbers in files]
    known = {number for number in told if number is not None}
    ends = {max(numbers) for numbers, number in zip(files, told, strict=True) if numbers and number is None}
    others = known.pop() if len(known) == 1 else 0 if length - 1 in ends else image
    return [others if number is None else number for number in told]


def _own_first_number(numbers: Sequence[int], image: int, length: int) -> int | None:
    """Return what a camera's own numbers tell of frame 0's, None where they may count from either."""
    if not numbers or image <= min(numbers) <= max(numbers) < length:
        return None
    return 0 if min(numbers) < image else image


def read_keypoints(path: Path) -> F64:
    """Return the keypoints (N people, K, 3) of a file: px, px, confidence, as the file has them.

    Nobody in the picture gives (0, 0, 3).

    Raises:
        RecordingError: the file is not in OpenPose's format.
    """
    content = read_json(path, FORM)
    try:
        rows = [_points(person["pose_keypoints_2d"]) for person in content["people"]]
        return np.stack(rows) if rows else np.empty((0, 0, 3))
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise RecordingError(f"{NONE}: {error}", where=str(path), hint=FORM) from error


def _points(numbers: Sequence[float]) -> F64:
    """Return keypoints (K, 3) from a row of numbers.

    Raises:
        ValueError: they are no triples.
    """
    row = np.array(numbers, np.float64)
    if row.size % 3:
        raise ValueError(f"{row.size} numbers, which are not three a point")
    return row.reshape(-1, 3)


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


def odd_keypoints(camera: Camera, folder: Path, length: int, first: int = 0) -> list[str]:
    """Say what is odd about the keypoints of a camera with `length` frames; every file is read (60 us each).

    `first` is the number of frame 0's file.
    """
    files = keypoint_files(folder, first)
    broken, gaps, unsure, counts, farthest, seen, outside = [], [], [], set(), 0.0, 0, 0
    why = ""  # the first that can't be read can't
    for index, path in files.items():
        try:
            people = read_keypoints(path)
        except RecordingError as error:
            broken.append(index)
            why = why or error.message.removeprefix(f"{NONE}: ")
            continue
        counts |= {people.shape[1]} if len(people) else set()
        gaps += [index] if not np.isfinite(people).all() else []
        unsure += [index] if (people[..., 2] > SUREST).any() else []
        farthest = max(farthest, float(np.nanmax(np.abs(people[..., :2]), initial=0.0)))
        known = people[people[..., 2] > 0, :2]
        seen, outside = seen + len(known), outside + int(((known < 0) | (known > camera.size)).any(axis=1).sum())
    beyond, missing = [i for i in files if i >= length], [i for i in range(length) if i not in files]
    faults = (
        (broken, f"can't be read ({why}): nobody is seen there"),
        (gaps, "are not all numbers (NaN): these points count as not seen"),
        (unsure, "have confidences far beyond 1: are they percents, or is there none behind x and y?"),
        (beyond, f"lie after the last frame, {length - 1}: they are left out"),
        (missing, "are missing: nobody is seen there"),
    )
    odd = [f"{camera.name}: keypoints of {name_frames(indices)} {what}" for indices, what in faults if indices]
    name = camera.name
    if len(counts) > 1:
        odd.append(f"{name}: people with {' and with '.join(map(str, sorted(counts)))} keypoints in one folder")
    if 0 < farthest <= 1:
        odd.append(f"{name}: all keypoints lie within one pixel: are they shares of the picture? expected pixels")
    if camera.size.all() and outside > MOSTLY * seen:
        pictures = f"its pictures of {camera.size[0]} x {camera.size[1]} px"
        odd.append(f"{name}: most keypoints lie outside {pictures}: are they of pictures of another size?")
    return odd
