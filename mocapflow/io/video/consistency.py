"""What videos and calibration have to agree on: sizes and lengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.cameras.lens_checks import check_focal_length, odd_lens
from mocapflow.io.json_toml import place
from mocapflow.io.video.images import name_frames
from mocapflow.io.video.lateness import TIMING
from mocapflow.io.video.reading import Video

CUT = 0.02  # share of the width or height that a video may lack against its calibration
TURNED = (
    "the video is turned by a quarter, perhaps by a mark in the file that players heed and other\n"
    "programs do not: calibrate with pictures that are turned the same way; or size is not [width, height]"
)
RESIZED = "calibrate at the size of the video, or scale size and matrix of the calibration to it"


def fit_sizes(
    cameras: Sequence[Camera], videos: Sequence[Video], calibration: Path
) -> tuple[tuple[Camera, ...], list[str]]:
    """Return the cameras with the size of their videos, and what is odd about them.

    A slightly smaller video was cut at the right and bottom.

    Raises:
        RecordingError: a video has another size than its calibration, or a focal length is not in pixels.
    """
    lenses, warnings = [], []
    for camera, video in zip(cameras, videos, strict=True):
        size = np.array([video.width, video.height], np.int32)
        if camera.size.any() and (size != camera.size).any():
            sizes = f"the video is {size[0]} x {size[1]} px, the calibration {camera.size[0]} x {camera.size[1]}"
            if (size > camera.size).any() or (size < (1 - CUT) * camera.size).any():
                hint = TURNED if (size[::-1] == camera.size).all() else RESIZED
                where = place(calibration, camera.name)
                raise RecordingError(f"camera '{camera.name}': {sizes}", where=where, hint=hint)
            warnings.append(f"{camera.name}: {sizes}: taken as cut at the right and bottom")
        lens = replace(camera, size=size)
        check_focal_length(lens, calibration)
        warnings += odd_lens(lens)
        lenses.append(lens)
    return tuple(lenses), warnings


def agree_on_length(cameras: Sequence[Camera], videos: Sequence[Video], folder: Path) -> tuple[int, list[str]]:
    """Return the common number of frames; a video that breaks off counts with what it declares."""
    lengths = {video.frames for video in videos}
    if len(lengths) == 1:
        return lengths.pop(), []
    broken = [video.frames < video.declared for video in videos]
    lengths = {v.declared if b else v.frames for v, b in zip(videos, broken, strict=True)}
    if len(lengths) > 1:
        counts = ", ".join(f"{c.name}: {_extent(v)}" for c, v in zip(cameras, videos, strict=True))
        if all(video.path.is_dir() for video in videos):
            cut = "images of one instant have one number in all folders: number them anew, or remove what others lack"
        else:
            cut = (
                "cut them to the same moments: frame i must be the same instant in every video:\n"
                f"ffmpeg -i IN -ss SECONDS -frames:v {min(lengths)} -crf 12 OUT"
            )
        hint = f"{counts}\n{cut}; then `mocapflow doctor DIR --sync`"
        raise RecordingError("the videos differ in length", where=str(folder / "videos"), hint=hint)
    length = lengths.pop()
    return length, [
        f"{camera.name}: the video breaks off after frame {video.frames - 1} of {length}; it is not used from there on"
        for camera, video, cut in zip(cameras, videos, broken, strict=True)
        if cut
    ]


def _extent(video: Video) -> str:
    """Return how long a video is, as its files tell."""
    if video.path.is_dir():
        return f"images {video.numbers[0] + video.first} to {video.numbers[-1] + video.first}"
    return f"{video.frames} frames"


def check_lateness(cameras: Sequence[Camera], videos: Sequence[Video], length: int, folder: Path) -> None:
    """Check that a late camera has a picture of any of the `length` frames.

    Raises:
        RecordingError: it is later than the recording is long.
    """
    for camera, video in zip(cameras, videos, strict=True):
        if abs(video.late) >= length:
            what = f"camera '{camera.name}' is {video.late} frames late in a recording of {length}"
            hint = "late_frames counts frames, not milliseconds; `mocapflow doctor DIR --sync` measures it"
            raise RecordingError(what, where=place(folder / TIMING, camera.name), hint=hint)


def gap_warnings(cameras: Sequence[Camera], videos: Sequence[Video]) -> list[str]:
    """Say which frames within each video are not there."""
    return [
        f"{camera.name}: {name_frames(lost)} missing in the video; the view is not used there"
        for camera, video in zip(cameras, videos, strict=True)
        if (lost := sorted(set(range(video.frames)) - set(video.numbers.tolist())))
    ]


def first_warnings(videos: Sequence[Video]) -> list[str]:
    """Say which image is frame 0 where that is not the one with number 0."""
    first = videos[0].first
    return [f"the images are numbered from {first} on: number {first} is frame 0"] if first else []
