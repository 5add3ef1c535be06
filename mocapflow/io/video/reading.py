"""The one reader of videos: frames exactly in order, a placeholder with a reason where one is lost.

The number of a frame comes from its time stamp, so a frame that the file lacks, or that can't be decoded, leaves
a gap and does not shift the rest. All stamps are read once, without decoding, when a video is opened. Decoding always
starts at the first frame: seeking lands on the wrong picture in some files, and a resumed run must see the same pixels.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.paths import led_nowhere
from mocapflow.io.video.decoding import judged
from mocapflow.io.video.images import IMAGES, check_depth, check_numbers, numbered, read_image
from mocapflow.io.video.packets import open_stream, picture, read_stamps
from mocapflow.records import I32, U8, array, record

NO_MORE = (sys.maxsize, None, "")  # what comes after all frames
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".mts", ".m2ts", ".ts", ".wmv", ".3gp")


@record
class Video:
    """What a camera saw: a video file or a folder of numbered images."""

    path: Path
    width: int  # px
    height: int  # px
    frame_rate: float  # per second; 0 where nothing says it
    declared: int  # frames, as the file says; more than `frames` where it breaks off
    numbers: I32 = array("N", unit="frame number of each packet, in the order of the file; HIDDEN where none is shown")
    starts: I32 = array("N", unit="packet of the key frame from which each is decoded")
    uneven: float = 0.0  # frames by which a picture's time is off an even rhythm of the numbers, at most
    interlaced: bool = False  # every picture mixes two moments
    first: int = 0  # number in the name of frame 0's image
    late: int = 0  # frames by which its pictures come after those of the other cameras

    @property
    def frames(self) -> int:
        """Frames up to the last one in the file, gaps included."""
        return int(self.numbers.max()) + 1


def open_video(path: Path) -> Video:
    """Open a video file or a folder of images; only the first picture is decoded.

    Raises:
        RecordingError: it is not there, nothing in it can be decoded, two images are of one frame, or they are numbered
            by their time or far too dark.
    """
    if lost := led_nowhere(path):
        raise RecordingError("there is no such video", where=str(path), hint=lost)
    if path.is_dir():
        return _open_folder(path)
    if not os.access(path, os.R_OK):  # ffmpeg would only say that it can't be decoded
        hint = "let yourself read it, or copy it to a place of yours"
        raise RecordingError("this video may not be read: permission denied", where=str(path), hint=hint)
    return Video(path=path, **read_stamps(path)._asdict())


def count_from_first(videos: Sequence[Video]) -> tuple[Video, ...]:
    """Return videos whose frame 0 is the first image that any camera has, where all are folders of images.

    Who cuts a video into images counts from 1, and who takes a part of a recording keeps its numbers.
    """
    first = min(int(video.numbers[0]) if video.path.is_dir() else 0 for video in videos)
    return tuple(
        replace(video, numbers=video.numbers - first, declared=video.declared - first, first=first) for video in videos
    )


def read_frames(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    """Yield exactly one image (H, W, 3) BGR per index, or None and why it is lost; memory stays bounded.

    Index 0 is the first frame of a punctual camera; a late camera's pictures are taken from further on.
    """
    ahead = video.late + video.first  # first is 0 in files
    indices = range(indices.start + ahead, indices.stop + ahead, indices.step)
    pictures = _folder_pictures(video, indices) if video.path.is_dir() else _file_pictures(video, indices)
    for image, reason in pictures:
        if image is not None and image.shape != (video.height, video.width, 3):
            height, width = image.shape[:2]
            yield None, f"the frame is {width} x {height}, the others {video.width} x {video.height}"
        else:
            yield image, reason


def _file_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    with open_stream(video.path) as stream:
        decoded = judged(stream, video.numbers, video.starts)
        current, frame, flaw = next(decoded, NO_MORE)
        for index in indices:
            while current < index:
                current, frame, flaw = next(decoded, NO_MORE)
            if frame is None or current > index:
                yield None, _why_lost(video, index)
            else:
                yield (None, flaw) if flaw else (picture(frame), "")


def _why_lost(video: Video, index: int) -> str:
    if index < 0:
        return "the video starts later"
    if index >= video.frames:
        broken = video.frames < video.declared
        return f"the video breaks off after frame {video.frames - 1}" if broken else "the video ends earlier"
    if index not in video.numbers:
        return "the frame is missing in the video: its time stamps jump"
    return "the frame can't be decoded"


def _open_folder(path: Path) -> Video:
    files = numbered(path, IMAGES)
    found = ((f, i) for f in files.values() if (i := read_image(f)) is not None)
    first, image = next(found, (path, None))
    if image is None:
        hint = f"images are named by frame: 000000.png, 000001.png; they end in {', '.join(IMAGES)}"
        raise RecordingError("no image in this folder can be read", where=str(path), hint=hint)
    check_depth(first)
    check_numbers(files, path)
    height, width = image.shape[:2]
    numbers = np.array(sorted(files), np.int32)
    return Video(
        path=path,
        width=width,
        height=height,
        frame_rate=0.0,
        declared=max(files) + 1,
        numbers=numbers,
        starts=np.arange(len(numbers), dtype=np.int32),
    )


def _folder_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    files = numbered(video.path, IMAGES)
    for number in indices:
        if number not in files:
            yield None, "there is no image of this frame"
            continue
        image = read_image(files[number])
        yield (None, f"{files[number].name} can't be read") if image is None else (image, "")
