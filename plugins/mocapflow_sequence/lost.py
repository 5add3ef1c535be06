"""What is a guess: frames of a track that were lost, angles that the priors hold."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, Bool
from mocapflow.results import Track

HALF = 0.5  # of an angle's variance: where the images take away less, the priors decide it


def lost_rows(track: Track) -> Bool:
    """Return (T,) True where nothing was fitted."""
    return np.array([is_lost(track, row) for row in range(len(track.frame))], bool)


def is_lost(track: Track, row: int) -> bool:
    """Return True where nothing was fitted: the loop made no turn, no view was usable, or nothing is known."""
    usable, known = track.usable[row], np.isfinite(track.covariance[row])
    return bool(track.iterations[row] == 0 or (len(usable) and not usable.any()) or not known.all())


def unseen(observed: F64) -> Bool:
    """Return True where the priors decided an angle, by the share that was observed; False where that is unknown."""
    held: Bool = observed < HALF
    return held
