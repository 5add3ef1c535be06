"""The one video decoder: frames exactly in order, a placeholder with a reason where one is lost.

The number of a frame comes from its time stamp, so a frame that the file lacks, or that can't be decoded, leaves
a gap and does not shift the rest (but in an AVI with reordered frames, which has no times of display). What comes
between a frame that can't be decoded and the next key frame is lost, too; damage that the decoder paints over is not
told. All stamps are read once, without decoding, when a video is opened. Decoding always starts at the first frame:
seeking lands on the wrong picture in some files, and a resumed run must see the same pixels.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.images import IMAGES, check_depth, check_numbers, numbered, read_image
from mocapflow.io.paths import led_nowhere
from mocapflow.io.stamps import grabs, number_frames, open_capture, read_stamps
from mocapflow.records import F64, I32, U8, Bool, array, record

NO_MORE = (sys.maxsize, False)  # the number after those of all frames
TORN = "the frame is decoded from damaged ones"
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm", ".mpg")


@record
class Video:
    """What a camera saw: a video file or a folder of numbered images."""

    path: Path
    width: int  # px
    height: int  # px
    frame_rate: float  # per second; 0 where nothing says it
    declared: int  # frames, as the file says; more than `frames` where it breaks off
    stamps: F64 = array("N", unit="ms, time of each frame in the file, ascending; counted for images")
    numbers: I32 = array("N", unit="frame number of each stamp")
    keys: Bool = array("N", unit="True for frames that are decoded from nothing but themselves")
    after_damage: Bool = array("N", unit="True for frames right before which the file can't be read")
    first: int = 0  # number in the name of frame 0's image
    late: int = 0  # frames by which its pictures come after those of the other cameras

    @property
    def frames(self) -> int:
        """Frames up to the last one in the file, gaps included."""
        return int(self.numbers[-1]) + 1 if len(self.numbers) else 0


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
    declared, rate, stamps, keys, after_damage = read_stamps(path)
    with open_capture(path) as capture:
        first = next((image for _ in grabs(capture) if (image := capture.retrieve()[1]) is not None), None)
    if first is None or not len(stamps):
        raise RecordingError(
            "this video can't be decoded",
            where=str(path),
            hint="the file is cut off, damaged or no video; copy it again from the camera",
        )
    numbers = number_frames(stamps)
    if numbers[-1] >= len(numbers):  # with gaps the declared rate is the average
        rate = 1000 * float(numbers[-1]) / float(stamps[-1] - stamps[0])
    height, width = first.shape[:2]
    return Video(
        path=path,
        width=width,
        height=height,
        frame_rate=rate,
        declared=max(declared, int(numbers[-1]) + 1),
        stamps=stamps,
        numbers=numbers,
        keys=keys,
        after_damage=after_damage,
    )


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
    with open_capture(video.path) as capture:
        decoded = _decoded(capture, video)
        current, torn = next(decoded, NO_MORE)
        for index in indices:
            while current < index:
                current, torn = next(decoded, NO_MORE)
            done, image = capture.retrieve() if current == index and not torn else (False, None)
            yield (image, "") if done else (None, TORN if current == index and torn else _why(video, index))


def _why(video: Video, index: int) -> str:
    if index < 0:
        return "the video starts later"
    if index >= video.frames:
        return f"the video breaks off after frame {video.frames - 1}"
    if index not in video.numbers:
        return "the frame is missing in the video: its time stamps jump"
    return "the frame can't be decoded"


def _decoded(capture: Any, video: Video) -> Iterator[tuple[int, bool]]:
    """Yield the number of each frame as it is decoded, and whether that is from frames that could not be.

    A decoder goes on after a damaged frame with the differences from it, up to the next key frame.
    """
    import cv2

    by_count = video.stamps[0] == video.stamps[-1]
    before, torn = -1, False
    for count, _ in enumerate(grabs(capture)):
        now = capture.get(cv2.CAP_PROP_POS_MSEC)
        if count == 0 and now != video.stamps[0] and video.path.suffix.lower() == ".avi":
            by_count = True  # AVI keeps no times of display: with reordered frames only their order is known
        row = count if by_count else int(np.abs(video.stamps - now).argmin())
        torn = (torn or _lost_between(video, before, row)) and not video.keys[row]
        before = row
        yield int(video.numbers[row]), torn


def _lost_between(video: Video, before: int, row: int) -> bool:
    """Return whether a frame was lost between two that are decoded one after the other; -1: before the first.

    What a camera left out at once, so that times jump, is no loss.
    """
    since = np.searchsorted(video.stamps, video.stamps[before], "right") if before >= 0 else 0
    skipped = since < np.searchsorted(video.stamps, video.stamps[row])  # of frames with one time one alone is told
    return bool(skipped or video.after_damage[row])


def _open_folder(path: Path) -> Video:
    files = numbered(path, IMAGES)
    found = ((f, i) for f in files.values() if (i := read_image(f)) is not None)
    first, image = next(found, (path, None))
    if image is None:
        raise RecordingError(
            "no image in this folder can be read",
            where=str(path),
            hint="images are named by frame: 000000.png, 000001.png",
        )
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
        stamps=np.arange(len(numbers), dtype=np.float64),
        numbers=numbers,
        keys=np.ones(len(numbers), bool),
        after_damage=np.zeros(len(numbers), bool),
    )


def _folder_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    files = numbered(video.path, IMAGES)
    for number in indices:
        if number not in files:
            yield None, "there is no image of this frame"
            continue
        image = read_image(files[number])
        yield (None, f"{files[number].name} can't be read") if image is None else (image, "")
