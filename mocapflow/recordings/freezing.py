"""Cameras that hang: they give one picture again and again while the others see things move."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.records import F64, U8, Bool

STRIDE = 4  # px of a picture, where it is compared with the one before it
NO_CHANGE = 0.1  # share of the usual change in a picture that repeats the one before, give or take what a codec adds
SOME_CHANGE = 0.5  # share that at least half of the cameras show meanwhile; else the person may just stand still
LONG = 5  # frames with motion that a camera lets pass to the end, at least; fewer may be chance. An odd number


def difference(picture: U8, before: U8) -> float:
    """Return by how many grey levels two pictures (H, W, 3) differ, mean absolute."""
    return float(np.abs(picture[::STRIDE, ::STRIDE].astype(np.int16) - before[::STRIDE, ::STRIDE]).mean())


def repeated(change: F64) -> Bool:
    """Return (T, C) which pictures repeat the one before though at least half of the cameras see things move.

    Args:
        change: (T, C) differences to the picture before, NaN without one.
    """
    shares = _shares(change)
    return (shares < NO_CHANGE) & _moving(shares)[:, None]


def frozen_from(change: F64) -> npt.NDArray[np.intp]:
    """Return (C,) from which frame on each camera repeats one picture to the end while others see motion; T: none.

    That the others pause in between does not end it: its picture shows the pose of an earlier moment then, too.
    """
    if len(change) < LONG:
        return np.full(change.shape[1], len(change))
    shares = _shares(change)
    new = _calmed(shares) >= NO_CHANGE
    since = np.where(new.any(axis=0), len(change) - new[::-1].argmax(axis=0), 0)
    passed = np.isfinite(shares) & _moving(shares)[:, None] & (np.arange(len(change))[:, None] >= since)
    return np.where(passed.sum(axis=0) >= LONG, since, len(change))


def _calmed(shares: F64) -> F64:
    """Return the median (T, C) of LONG frames around each: a codec draws a whole picture anew now and then."""
    windows = np.lib.stride_tricks.sliding_window_view(np.nan_to_num(shares), LONG, axis=0)
    return np.pad(np.median(windows, axis=-1), ((LONG // 2, LONG // 2), (0, 0)), mode="edge")


def _shares(change: F64) -> F64:
    """Return the change (T, C) as shares of what is usual for the camera."""
    return change / np.maximum(_usual(change), 1e-9)


def _usual(change: F64) -> F64:
    """Return the median change (C,) of each camera over frames in which there is some; 1 where nothing is known.

    A camera that hangs for most of the time has next to none at the median: all that a codec adds would be change.
    """
    known = [column[np.isfinite(column)] for column in change.T]
    usual = float(np.median([np.median(column) if len(column) else 1.0 for column in known]))
    some = [column[column > NO_CHANGE * usual] for column in known]
    return np.array([np.median(column) if len(column) else usual for column in some])


def _moving(shares: F64) -> Bool:
    """Return (T,) in which frames at least half of the cameras see things move."""
    most: Bool = (shares > SOME_CHANGE).sum(axis=1) >= 0.5 * np.isfinite(shares).sum(axis=1)
    return most
