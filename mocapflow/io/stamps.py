"""Time stamps of the frames of a video file, read without decoding it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mocapflow.io.paths import for_opencv
from mocapflow.records import F64, I32, Bool


class Stamps(NamedTuple):
    """What a video file says of its frames."""

    declared: int  # frames
    rate: float  # frames a second; 0 where it does not say
    time: F64  # (N,) ms, ascending
    key: Bool  # (N,) whether a frame is decoded from nothing but itself
    after_damage: Bool  # (N,) whether what the file has right before a frame can't be read


@contextmanager
def open_capture(path: Path, *options: int) -> Iterator[Any]:
    """Open a video file with one thread; options are pairs of cv2.CAP_PROP_* and value."""
    import cv2

    capture = cv2.VideoCapture(for_opencv(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1, *options])
    try:
        yield capture
    finally:
        capture.release()


def grabs(capture: Any) -> Iterator[int]:
    """Advance frame by frame to the end, over damaged ones; yields how many attempts failed before each."""
    import cv2

    declared = capture.get(cv2.CAP_PROP_FRAME_COUNT)  # anything at all, in a damaged file
    patience = int(np.clip(np.nan_to_num(declared), 1000, 1_000_000))  # failed attempts at the end cost nothing
    failed = 0
    while failed < patience:
        if not capture.grab():
            failed += 1
            continue
        yield failed
        failed = 0


def read_stamps(path: Path) -> Stamps:
    """Return the time stamps of a video file; nothing is decoded."""
    import cv2

    with open_capture(path, cv2.CAP_PROP_FORMAT, -1) as capture:
        declared, rate = capture.get(cv2.CAP_PROP_FRAME_COUNT), capture.get(cv2.CAP_PROP_FPS)
        what = cv2.CAP_PROP_POS_MSEC, cv2.CAP_PROP_LRF_HAS_KEY_FRAME
        read = np.array([[*(capture.get(each) for each in what), failed] for failed in grabs(capture)]).reshape(-1, 3)
    rate = rate if np.isfinite(rate) and 0 < rate < 1e5 else 0.0
    stamps, keys, failed = read[np.argsort(read[:, 0], kind="stable")].T
    known = stamps >= 0
    return Stamps(max(0, int(declared)), rate, stamps[known], keys[known] > 0, failed[known] > 0)


def number_frames(stamps: F64) -> I32:
    """Return the frame number (N,) of each stamp (N,) ms: a gap of k periods is k - 1 lost frames."""
    gaps = np.diff(stamps)
    period = np.median(gaps) if len(gaps) else 0.0
    steps = np.maximum(1, np.round(gaps / period)) if period > 0 else np.ones(len(gaps))
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int32)
