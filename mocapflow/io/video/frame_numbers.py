"""Which frames the pictures of a video are, by their times."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, I32

SPREAD = 0.5  # of the median gap, by which usual ones may differ from it; where frames are lost they differ by more
AHEAD = 8  # pictures, among which those that follow a late one at once catch up


def number_frames(times: F64) -> I32:
    """Return the frame number (N,) at each time (N,), in any unit and order: a gap of k periods is k - 1 lost frames.

    What has one time, such as what VP8 never shows, has one number. A picture that is late, as those after it that
    come at once tell, is no gap.
    """
    moments, place = np.unique(times, return_inverse=True)
    if len(moments) < 2:
        return np.arange(len(times), dtype=np.int32)
    period = _period(np.diff(moments))
    steps = np.maximum(1, np.round(np.diff(_undelayed(moments, period)) / period))
    return np.append(0, np.cumsum(steps)).astype(np.int32)[place]


def _period(gaps: F64) -> float:
    """Return the mean of the usual gaps (N,): their median alone is put off where times are in whole milliseconds."""
    middle = np.quantile(gaps, 0.5, method="lower")
    return float(gaps[np.abs(gaps - middle) < SPREAD * middle].mean())


def _undelayed(times: F64, period: float) -> F64:
    """Return the latest time (N,) for each, in order, that leaves a period before each of the next."""
    ahead = np.append(times, np.full(AHEAD, np.inf))
    windows = np.lib.stride_tricks.sliding_window_view(ahead, AHEAD + 1)
    latest: F64 = (windows - period * np.arange(AHEAD + 1)).min(axis=1)
    return latest


def unevenness(times: F64, numbers: I32) -> float:
    """Return by how many frames a picture at its time (N,) is off an even rhythm of the numbers (N,), at most."""
    if len(times) < 3 or np.ptp(times) == 0:
        return 0.0
    period, start = np.polyfit(numbers, times, 1)
    return float(np.abs((times - start) / period - numbers).max())
