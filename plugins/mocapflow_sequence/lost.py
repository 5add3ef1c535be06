"""What is a guess: frames of a track that were lost, angles that no image shows."""

from __future__ import annotations

import numpy as np

from mocapflow.records import F64, Bool
from mocapflow.results import Track

HALF = 0.5  # of an angle's variance: where the images take away less, the priors decide it


def lost_rows(track: Track) -> Bool:
    """Return (T,) True where nothing was fitted: the loop made no turn, no view was usable, or nothing is known."""
    blind = ~track.usable.any(axis=1) if track.usable.shape[1] else np.zeros(len(track.frame), bool)
    unknown = ~np.isfinite(track.covariance).all((1, 2))
    lost: Bool = (track.iterations == 0) | blind | unknown
    return lost


def unseen(observed: F64) -> Bool:
    """Return True where the priors decided an angle, by the share that was observed; False where that is unknown."""
    held: Bool = observed < HALF
    return held
