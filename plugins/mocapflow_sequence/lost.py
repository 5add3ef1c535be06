"""Which frames of a track were lost: their poses are guesses."""

from __future__ import annotations

import numpy as np

from mocapflow.records import Bool
from mocapflow.results import Track


def lost_rows(track: Track) -> Bool:
    """Return (T,) True where nothing was fitted: the loop made no turn, no view was usable, or nothing is known."""
    blind = ~track.usable.any(axis=1) if track.usable.shape[1] else np.zeros(len(track.frame), bool)
    unknown = ~np.isfinite(track.covariance).all((1, 2))
    lost: Bool = (track.iterations == 0) | blind | unknown
    return lost
