"""Which frames of a track were lost, and what the track says about it."""

from __future__ import annotations

import re

import numpy as np

from mocapflow.data import Track
from mocapflow.records import Bool

NOTE = re.compile(r"^frame (\d+)\b.*\b(lost|bridged)\b")


def lost_rows(track: Track) -> Bool:
    """Return (T,) True where a pose was guessed: no usable view, a note that says so, or no finite covariance."""
    noted = [int(match[1]) for note in track.notes if (match := NOTE.match(note))]
    blind = ~track.usable.any(axis=1) if track.usable.shape[1] else np.zeros(len(track.frame), bool)
    unknown = ~np.isfinite(track.covariance).all((1, 2))
    lost: Bool = blind | unknown | np.isin(track.frame, noted)
    return lost
