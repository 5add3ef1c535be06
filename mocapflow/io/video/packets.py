"""What a video file holds: its packets, in the order of decoding, and which frames they are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.paths import for_opencv
from mocapflow.io.video.frame_numbers import number_frames, unevenness
from mocapflow.records import F64, I32, U8, Bool

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream

HIDDEN = np.iinfo(np.int32).min  # the number of a packet that players do not show
TRACK_END = re.compile(r"(\d+):(\d+):(\d+\.\d+)")
FASTEST = 1e5  # frames a second; what a file says beyond is nonsense
FEW = 1 / 16  # of an AVI's packets: if fewer are shown before the one before them, their times are guessed wrong
PATIENCE = 10_000  # failed attempts to read on; then the file is over


class Stamps(NamedTuple):
    """What a video file says of its frames: the fields of a `Video`."""

    width: int
    height: int
    frame_rate: float
    declared: int
    numbers: I32
    starts: I32
    uneven: float
    interlaced: bool


@contextmanager
def open_stream(path: Path) -> Iterator[VideoStream]:
    """Open the video in a file; it is decoded with one thread.

    Raises:
        RecordingError: there is none that can be decoded.
    """
    import av

    try:
        container = av.open(for_opencv(path), **_lenient(av.__version__))
    except av.FFmpegError:
        raise undecodable(path) from None
    with container:
        stream = container.streams.best("video")  # not the cover
        if not isinstance(stream, av.VideoStream) or stream.codec_context is None:
            raise undecodable(path)
        stream.codec_context.thread_count = 1
        yield stream


def _lenient(version: str) -> dict[str, Any]:
    """Return what makes a version of PyAV open a file whose title is no UTF-8; from 19 on it does so by itself."""
    return {"metadata_errors": "replace"} if int(version.partition(".")[0]) < 19 else {}


def undecodable(path: Path) -> RecordingError:
    """Return the error that nothing in a file can be decoded."""
    hint = "the file is cut off, damaged or no video; copy it again from the camera"
    return RecordingError("this video can't be decoded", where=str(path), hint=hint)


def packets(stream: VideoStream) -> Iterator[Packet[Any] | None]:
    """Yield the packets of a video, None where the file can't be read, and an empty one at the end."""
    import av

    container: Any = stream.container
    for _ in range(PATIENCE):
        try:
            yield from (packet for packet in container.demux(stream) if packet.size or packet.dts is None)
            return
        except av.FFmpegError:
            yield None


def decode(packet: Packet[Any] | None) -> tuple[list[VideoFrame], bool]:
    """Return which pictures are ready after a packet, and whether it is whole."""
    import av

    try:
        return (packet.decode(), not packet.is_corrupt) if packet is not None else ([], False)
    except av.FFmpegError:
        return [], False


def picture(frame: VideoFrame) -> U8:
    """Return a frame (H, W, 3) BGR, turned as players do; bicubic as in OpenCV, where colours are stored coarser."""
    image = frame.to_ndarray(format="bgr24", interpolation="BICUBIC", threads=1)
    return np.ascontiguousarray(np.rot90(image, 0 if frame.rotation % 90 else frame.rotation // 90))


def read_stamps(path: Path) -> Stamps:
    """Return what a video file says of its frames; only the first picture is decoded.

    Raises:
        RecordingError: nothing in it can be decoded.
    """
    with open_stream(path) as stream:
        container: Any = stream.container
        first, found = _read_packets(stream)
        times = np.where(np.isnan(found.shown_at), found.decoded_at, found.shown_at)
        starts = find_starts(times, found.key)
        if container.format.name == "avi" and np.count_nonzero(np.diff(times) < 0) < FEW * (len(times) - 1):
            times = found.decoded_at  # AVI has no times of display
        shown = ~np.isnan(times) & ~found.hidden
        if first is None or not shown.any():
            raise undecodable(path)
        numbers = np.full(len(times), HIDDEN, np.int32)
        numbers[shown] = number_frames(times[shown])
        frames = int(numbers.max()) + 1
        rate = float(stream.average_rate or 0)
        rate = rate if rate < FASTEST else 0.0
        declared = (stream.frames or round(_seconds(stream) * rate)) - int(found.hidden.sum())
        if frames > shown.sum():  # with gaps that rate is the average
            rate = (frames - 1) / float(np.ptp(times[shown]) * (stream.time_base or 0))
        height, width, _ = picture(first).shape
        uneven = unevenness(times[shown], numbers[shown])
    return Stamps(width, height, rate, max(declared, frames), numbers, starts, uneven, bool(first.interlaced_frame))


def _seconds(stream: VideoStream) -> float:
    """Return how long a video is said to be; Matroska tells in a tag when each track ends.

    The length of the file, where no other is known, is that of its sound, too.
    """
    container: Any = stream.container
    if stream.duration:
        return float(stream.duration * (stream.time_base or 0))
    if not (told := TRACK_END.fullmatch(stream.metadata.get("DURATION", ""))):
        return (container.duration or 0) / 1e6
    hours, minutes, seconds = map(float, told.groups())
    return 3600 * hours + 60 * minutes + seconds - float((stream.start_time or 0) * (stream.time_base or 0))


class Packets(NamedTuple):
    """What the packets (N,) of a video say; times in its own unit, NaN where they are not known."""

    shown_at: F64
    decoded_at: F64
    key: Bool
    hidden: Bool


def _read_packets(stream: VideoStream) -> tuple[VideoFrame | None, Packets]:
    """Return the first picture that can be decoded, None if there is none, and what all packets say."""
    first: list[VideoFrame] = []
    rows: list[tuple[float | None, float | None, bool, bool]] = []
    for packet in packets(stream):
        first = first or decode(packet)[0]
        if packet is None:
            rows.append((None, None, False, False))
        elif packet.size:
            rows.append((packet.pts, packet.dts, packet.is_keyframe, packet.is_discard))
    shown_at, decoded_at, key, hidden = np.array(rows, np.float64).reshape(-1, 4).T
    return (first[0] if first else None), Packets(shown_at, decoded_at, key > 0, hidden > 0)


def find_starts(times: F64, keys: Bool) -> I32:
    """Return the packet (N,) of the key frame from which each, shown at its time (N,), is decoded.

    What follows a key frame in the file but is shown before it is made from what came before, too.
    """
    key = np.maximum.accumulate(np.where(keys, np.arange(len(keys)), 0))
    return np.where(times < times[key], key[np.maximum(key - 1, 0)], key).astype(np.int32)
