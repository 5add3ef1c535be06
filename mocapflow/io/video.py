"""The one video decoder: frames exactly in order, a placeholder with a reason where one is lost.

The number of a frame comes from its time stamp, so a frame that the file lacks, or that can't be decoded, leaves
a gap and does not shift the rest. All stamps are read once, without decoding, when a video is opened. Decoding
always starts at the first frame: seeking lands on the wrong picture in some files, and a resumed run must see
the same pixels.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.stamps import grabs, number_frames, open_capture, read_stamps
from mocapflow.records import F64, I32, U8, array, record

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm", ".mpg")
DARK = 8192  # of 65535: a picture of 16 bits a pixel that reaches no more holds the 10 or 12 bits of a camera
NAMED = 5  # frames that a message lists
SPARSE = 1000  # frames for each image of a folder, above which the numbers are no frames


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
    late: int = 0  # frames by which its pictures come after those of the other cameras

    @property
    def frames(self) -> int:
        """Frames up to the last one in the file, gaps included."""
        return int(self.numbers[-1]) + 1 if len(self.numbers) else 0


def open_video(path: Path) -> Video:
    """Open a video file or a folder of images; only the first picture is decoded.

    Raises:
        RecordingError: nothing in it can be decoded, two images are of one frame, or they are numbered by their time
            or far too dark.
    """
    if path.is_dir():
        return _open_folder(path)
    declared, rate, stamps = read_stamps(path)
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
    )


def read_frames(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    """Yield exactly one image (H, W, 3) BGR per index, or None and why it is lost; memory stays bounded.

    Index 0 is the first frame of a punctual camera; a late camera's pictures are taken from further on.
    """
    indices = range(indices.start + video.late, indices.stop + video.late, indices.step)
    pictures = _folder_pictures(video, indices) if video.path.is_dir() else _file_pictures(video, indices)
    for image, reason in pictures:
        if image is not None and image.shape != (video.height, video.width, 3):
            height, width = image.shape[:2]
            yield None, f"the frame is {width} x {height}, the others {video.width} x {video.height}"
        else:
            yield image, reason


def lost_frames(video: Video) -> list[int]:
    """Return the numbers of the frames that there should be and that can't be used; decodes all of them."""
    wanted = range(video.declared)
    if video.path.is_dir():
        punctual = replace(video, late=0)
        return [index for index, (image, _) in zip(wanted, read_frames(punctual, wanted), strict=True) if image is None]
    with open_capture(video.path) as capture:
        return sorted(set(wanted) - set(_decoded(capture, video)))


def _file_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    with open_capture(video.path) as capture:
        decoded = _decoded(capture, video)
        current = next(decoded, None)
        for index in indices:
            while current is not None and current < index:
                current = next(decoded, None)
            done, image = capture.retrieve() if current == index else (False, None)
            yield (image, "") if done else (None, _why(video, index))


def _why(video: Video, index: int) -> str:
    if index < 0:
        return "the video starts later"
    if index >= video.frames:
        return f"the video breaks off after frame {video.frames - 1}"
    if index not in video.numbers:
        return "the frame is missing in the video: its time stamps jump"
    return "the frame can't be decoded"


def _decoded(capture: Any, video: Video) -> Iterator[int]:
    """Yield the number of each frame as it is decoded."""
    import cv2

    by_count = video.stamps[0] == video.stamps[-1]
    for count, _ in enumerate(grabs(capture)):
        now = capture.get(cv2.CAP_PROP_POS_MSEC)
        if count == 0 and now != video.stamps[0] and video.path.suffix.lower() == ".avi":
            by_count = True  # AVI keeps no times of display: with reordered frames only their order is known
        yield int(video.numbers[count if by_count else np.abs(video.stamps - now).argmin()])


def numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Return the files of a folder by frame number: the last run of digits in the name; hidden files are left out.

    Raises:
        RecordingError: two files have one number.
    """
    found: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        digits = re.findall(r"\d+", path.stem)
        if not digits or path.suffix.lower() not in suffixes or path.name.startswith("."):
            continue
        if (other := found.setdefault(int(digits[-1]), path)) != path:
            raise RecordingError(
                f"two files for frame {int(digits[-1])}: {other.name}, {path.name}",
                where=str(folder),
                hint="the last digits of a name are its frame, as in cam01_000012.png: rename the files, "
                "or remove those that are too many",
            )
    return found


def check_depth(path: Path) -> None:
    """Check that a picture of 16 bits a pixel uses them: of the higher 8, which are taken, nearly all would be 0.

    Raises:
        RecordingError: it does not.
    """
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is not None and image.dtype == np.uint16 and 0 < image.max() < DARK:
        raise RecordingError(
            f"a picture of 16 bits a pixel that reaches {image.max()} of 65535: as 8 bits it is nearly black",
            where=str(path),
            hint="save it as 8 bits, or multiply its values so that they use all 16: 12 bits by 16, 10 bits by 64",
        )


def name_frames(indices: Sequence[int]) -> str:
    """Return e.g. `frames 3, 4, 9 and 20 more`."""
    first = ", ".join(str(index) for index in indices[:NAMED])
    more = f" and {len(indices) - NAMED} more" if len(indices) > NAMED else ""
    return f"{'frame' if len(indices) == 1 else 'frames'} {first}{more}"


def _open_folder(path: Path) -> Video:
    import cv2

    files = numbered(path, IMAGES)
    found = ((f, i) for f in files.values() if (i := cv2.imread(str(f), cv2.IMREAD_COLOR)) is not None)
    first, image = next(found, (path, None))
    if image is None:
        raise RecordingError(
            "no image in this folder can be read",
            where=str(path),
            hint="images are named by frame: 000000.png, 000001.png",
        )
    check_depth(first)
    last = max(files)
    if last > SPARSE * (len(files) + NAMED):  # every frame that lacks would be told, one by one
        raise RecordingError(
            f"{len(files)} images, and {files[last].name} would be frame {last}",
            where=str(path),
            hint="the last digits of a name are its frame, not its time or date: rename to 000000.png, 000001.png",
        )
    height, width = image.shape[:2]
    numbers = np.array(sorted(files), np.int32)
    return Video(
        path=path,
        width=width,
        height=height,
        frame_rate=0.0,
        declared=last + 1,
        stamps=np.arange(len(numbers), dtype=np.float64),
        numbers=numbers,
    )


def _folder_pictures(video: Video, indices: range) -> Iterator[tuple[U8 | None, str]]:
    import cv2

    files = numbered(video.path, IMAGES)
    for index in indices:
        if index not in files:
            yield None, "there is no image of this frame"
            continue
        image = cv2.imread(str(files[index]), cv2.IMREAD_COLOR)
        yield (None, f"{files[index].name} can't be read") if image is None else (np.asarray(image, np.uint8), "")
