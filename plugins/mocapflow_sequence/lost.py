"""Frames of a track that were lost: their pose is a guess."""

from __future__ import annotations

import numpy as np

from mocapflow.data import blind
from mocapflow.records import Bool
from mocapflow.results import Track


def lost_rows(track: Track) -> Bool:
    """Return (T,) True where nothing was fitted."""
    return np.array([is_lost(track, row) for row in range(len(track.frame))], bool)


def is_lost(track: Track, row: int) -> bool:
    """Return True where nothing was fitted: no turn, no usable view, none that told anything, or nothing is known."""
    usable, known = track.usable[row], np.isfinite(track.covariance[row])
    unused = (len(usable) and not usable.any()) or blind(track.observed[row])
    return bool(track.iterations[row] == 0 or unused or not known.all())
