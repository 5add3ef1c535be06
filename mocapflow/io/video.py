"""The one video decoder: frames exactly in order, a placeholder with a reason where one is lost.

The number of a frame comes from its time stamp, so a frame that the file has lost leaves a gap and does not
shift the rest. Decoding always starts at the first frame: seeking lands on the wrong picture in some files, and
a resumed run must see the same pixels.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.records import U8, record

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm", ".mpg")


@record
class Video:
    """What a camera saw: a video file or a folder of numbered images."""

    path: Path
    width: int  # px
    height: int  # px
    frame_rate: float  # per second; 0 where the file does not say
    frames: int  # up to the last one that can be decoded
    declared: int  # as the file says; more than `frames` where it breaks off

    @property
    def black(self) -> U8:
        """A placeholder image (H, W, 3)."""
        return np.zeros((self.height, self.width, 3), np.uint8)


def open_video(path: Path) -> Video:
    """Open a video file or a folder of images and count its frames.

    The count that the file declares is believed where the last frame stands in its place, which decodes no more
    than the end of the file; otherwise every frame is decoded once.

    Raises:
        RecordingError: nothing in it can be decoded.
    """
    if path.is_dir():
        return _open_folder(path)
    import cv2

    with _capture(path) as capture:
        rate, declared = capture.get(cv2.CAP_PROP_FPS), int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        readable, image = capture.read()
    if not readable:
        raise RecordingError(
            "this video can't be decoded",
            where=str(path),
            hint="the file is cut off, damaged or no video; copy it again from the camera",
        )
    rate = rate if np.isfinite(rate) and 0 < rate < 1e5 else 0.0
    frames = declared if _ends_at(path, declared, rate) else _count(path, rate)
    height, width = image.shape[:2]
    return Video(path=path, width=width, height=height, frame_rate=rate, frames=frames, declared=max(declared, frames))


def read_frames(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    """Yield exactly one image (H, W, 3) BGR per index, or None and why it is lost; memory stays bounded."""
    pictures = _folder_pictures(video, indices) if video.path.is_dir() else _file_pictures(video, indices)
    for image, reason in pictures:
        if image is not None and image.shape != (video.height, video.width, 3):
            height, width = image.shape[:2]
            yield None, f"the frame is {width} x {height}, the others {video.width} x {video.height}"
        else:
            yield image, reason


def _file_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    with _capture(video.path) as capture:
        stamps = _stamps(capture, video.frame_rate)
        current = next(stamps, None)
        for index in indices:
            while current is not None and current < index:
                current = next(stamps, None)
            if current == index:
                decoded, image = capture.retrieve()
                yield (image, "") if decoded else (None, "the frame could not be decoded")
            elif current is None:
                yield None, f"the video breaks off after frame {video.frames - 1}"
            else:
                yield None, "the frame is missing in the video: its time stamps jump"


def _stamps(capture: Any, rate: float) -> Iterator[int]:
    """Yield the number of each frame as it is decoded; a gap in time is a gap in the numbers."""
    import cv2

    index, last = -1, 0.0
    while capture.grab():
        now = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000 * rate  # frames
        index += max(1, round(now - last)) if index >= 0 else 1
        last = now
        yield index


def _ends_at(path: Path, declared: int, rate: float) -> bool:
    """True where the last declared frame is there, in its place, and no other follows."""
    import cv2

    if declared < 1 or not rate:
        return False
    with _capture(path) as capture:
        capture.grab()
        first = capture.get(cv2.CAP_PROP_POS_MSEC)
        capture.set(cv2.CAP_PROP_POS_FRAMES, declared - 1)
        if declared > 1 and not capture.grab():
            return False
        passed = (capture.get(cv2.CAP_PROP_POS_MSEC) - first) / 1000 * rate
        return round(passed) == declared - 1 and not capture.grab()


def lost_frames(video: Video) -> list[int]:
    """Return the numbers of the frames that the file should have and lacks; decodes the whole file."""
    if video.path.is_dir():
        there = set(numbered(video.path, IMAGES))
    else:
        with _capture(video.path) as capture:
            there = set(_stamps(capture, video.frame_rate))
    return sorted(set(range(video.declared)) - there)


def _count(path: Path, rate: float) -> int:
    with _capture(path) as capture:
        return max(_stamps(capture, rate), default=-1) + 1


@contextmanager
def _capture(path: Path) -> Iterator[Any]:
    import cv2

    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    try:
        yield capture
    finally:
        capture.release()


def numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Return the files of a folder by frame number: the last run of digits in the name."""
    found = {}
    for path in sorted(folder.iterdir()):
        digits = re.findall(r"\d+", path.stem)
        if digits and path.suffix.lower() in suffixes:
            found[int(digits[-1])] = path
    return found


def _open_folder(path: Path) -> Video:
    import cv2

    files = numbered(path, IMAGES)
    image = next((i for f in files.values() if (i := cv2.imread(str(f), cv2.IMREAD_COLOR)) is not None), None)
    if image is None:
        raise RecordingError(
            "no image in this folder can be read",
            where=str(path),
            hint="images are named by frame: 000000.png, 000001.png",
        )
    count, (height, width) = max(files) + 1, image.shape[:2]
    return Video(path=path, width=width, height=height, frame_rate=0.0, frames=count, declared=count)


def _folder_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    import cv2

    files = numbered(video.path, IMAGES)
    for index in indices:
        if index not in files:
            yield None, "there is no image of this frame"
            continue
        image = cv2.imread(str(files[index]), cv2.IMREAD_COLOR)
        yield (None, f"{files[index].name} can't be read") if image is None else (np.asarray(image, np.uint8), "")
