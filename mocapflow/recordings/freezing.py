"""Cameras that hang: they give one picture again and again while the others see things move."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mocapflow.records import F64, U8, Bool

STRIDE = 4  # px of a picture, where it is compared with the one before it
NO_NEWS = 0.1  # share of the usual news in a picture that repeats the one before, give or take what a codec adds
SOME_NEWS = 0.5  # share that at least half of the cameras show meanwhile; else the person may just stand still
LONG = 5  # frames with motion that a camera lets pass to the end, at least; fewer may be chance. An odd number


def difference(picture: U8, before: U8) -> float:
    """Return by how many grey levels two pictures (H, W, 3) differ, mean absolute."""
    return float(np.abs(picture[::STRIDE, ::STRIDE].astype(np.int16) - before[::STRIDE, ::STRIDE]).mean())


def repeated(news: F64) -> Bool:
    """Return (T, C) which pictures repeat the one before though at least half of the cameras see things move.

    Args:
        news: (T, C) differences to the picture before, NaN without one.
    """
    shares = _shares(news)
    old: Bool = (shares < NO_NEWS) & _moving(shares)[:, None]
    return old


def frozen_from(news: F64) -> npt.NDArray[np.intp]:
    """Return (C,) from which frame on each camera repeats one picture to the end while others see motion; T: none.

    That the others pause in between does not end it: its picture shows the pose of an earlier moment then, too.
    """
    if len(news) < LONG:
        return np.full(news.shape[1], len(news))
    shares = _shares(news)
    new = _calmed(shares) >= NO_NEWS
    since = np.where(new.any(axis=0), len(news) - new[::-1].argmax(axis=0), 0)
    passed = np.isfinite(shares) & _moving(shares)[:, None] & (np.arange(len(news))[:, None] >= since)
    return np.where(passed.sum(axis=0) >= LONG, since, len(news))


def _calmed(shares: F64) -> F64:
    """Return the median (T, C) of LONG frames around each: a codec draws a whole picture anew now and then."""
    windows = np.lib.stride_tricks.sliding_window_view(np.nan_to_num(shares), LONG, axis=0)
    return np.pad(np.median(windows, axis=-1), ((LONG // 2, LONG // 2), (0, 0)), mode="edge")


def _shares(news: F64) -> F64:
    """Return news (T, C) as shares of what is usual for the camera."""
    return news / np.maximum(_usual(news), 1e-9)


def _usual(news: F64) -> F64:
    """Return the median news (C,) of each camera over frames that bring it some; 1 where nothing is known.

    A camera that hangs for most of the time has next to none at the median: all that a codec adds would be news.
    """
    known = [column[np.isfinite(column)] for column in news.T]
    usual = float(np.median([np.median(column) if len(column) else 1.0 for column in known]))
    some = [column[column > NO_NEWS * usual] for column in known]
    return np.array([np.median(column) if len(column) else usual for column in some])


def _moving(shares: F64) -> Bool:
    """Return (T,) in which frames at least half of the cameras see things move."""
    most: Bool = (shares > SOME_NEWS).sum(axis=1) >= 0.5 * np.isfinite(shares).sum(axis=1)
    return most
