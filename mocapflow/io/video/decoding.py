"""The frames of a video file as they are decoded, and which of them are damaged.

What is made from a frame that can't be decoded, or over whose damage the decoder painted, is lost, too; those of H.264
and MPEG-4 tell that they do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import chain, islice
from typing import TYPE_CHECKING

import numpy as np

from mocapflow.io.video.packets import HIDDEN, decode, packets
from mocapflow.records import I32, Bool

if TYPE_CHECKING:
    from av import VideoFrame, VideoStream

DAMAGED, TORN = "the frame is damaged", "the frame is decoded from damaged ones"


def judged(stream: VideoStream, numbers: I32, starts: I32) -> Iterator[tuple[int, VideoFrame, str]]:
    """Yield the number of each frame, its picture, and what is wrong with it.

    A decoder goes on after a damaged frame with the differences from it, up to the next key frame. That it painted
    over damage it tells with the picture, so a frame waits for those, shown later, that it may be made from.

    Args:
        stream: the video.
        numbers: (N,) of a `Video`.
        starts: (N,) of a `Video`.
    """
    damaged = np.zeros(len(numbers) + 1, bool)
    latest = np.maximum.accumulate(numbers)
    waiting: deque[tuple[int, int, VideoFrame]] = deque()
    for decoded in chain(_numbered(stream, numbers, damaged), [None]):
        while waiting and (decoded is None or latest[waiting[0][1]] <= decoded[0]):
            number, place, frame = waiting.popleft()
            since = slice(starts[place], place)
            used = starts[since] >= since.start  # what is shown before a key frame is not used after it
            torn = damaged[since][used].any()
            yield number, frame, DAMAGED if damaged[place] else TORN if torn else ""
        if decoded is not None:
            waiting.append(decoded)


def _numbered(stream: VideoStream, numbers: I32, damaged: Bool) -> Iterator[tuple[int, int, VideoFrame]]:
    """Yield number, packet and picture of each frame as it is decoded, in the order of display; marks damaged packets.

    Some files keep no times of display: their frames, if reordered, are numbered in the order in which they come.
    """
    from av.video.frame import PictureType

    timeless, reordered = bool((np.diff(numbers[numbers != HIDDEN]) > 0).all()), False
    due: list[int] = []  # packets whose pictures are to come
    for place, packet in enumerate(islice(packets(stream), len(damaged))):
        if packet is not None:
            packet.pts = place  # its picture gets it, too
        frames, whole = decode(packet)
        damaged[place] |= not whole
        if whole and place < len(numbers) and numbers[place] != HIDDEN:
            due.append(place)
        for frame in frames:
            own = int(frame.pts or 0)
            damaged[own] |= frame.is_corrupt
            reordered |= timeless and frame.pict_type == PictureType.B
            turn = own
            if reordered:  # times are those of decoding: each picture takes the first that is due
                turn = min((each for each in due if each >= own or not frame.key_frame), default=own)
            number = int(numbers[turn])
            damaged[[each for each in due if numbers[each] < number]] = True  # passed over without a word
            due = [each for each in due if numbers[each] > number]
            yield number, own, frame
