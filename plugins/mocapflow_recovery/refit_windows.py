"""Which frames a second look reads together, so that no picture is decoded twice and few are in memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mocapflow.data import Frame
from mocapflow.recordings.recording import Recording
from mocapflow.records import I32, Bool

WINDOW = 8  # pictures of each camera in memory
LEAD_IN = 4  # frames before a leap that may have to be looked at again as well, one by one


def windows(suspect: Bool) -> Iterator[I32]:
    """Yield rows that hang together, at most `WINDOW`: suspect ones (T,), those that led to them, and the one after.

    The last row of each is there for what it shows alone; where a window is cut, it is the first of the next.
    """
    wanted = suspect.copy()
    for back in range(1, LEAD_IN + 1):
        wanted[:-back] |= suspect[back:]
    wanted[1:] |= suspect[:-1]
    rows = np.flatnonzero(wanted).astype(np.int32)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        for end in range(len(run) - (len(run) - 2) // (WINDOW - 1) * (WINDOW - 1), len(run) + 1, WINDOW - 1):
            yield run[max(end - WINDOW, 0) : end]


def pictured(recording: Recording, numbers: I32, groups: Iterable[I32]) -> Iterator[tuple[I32, list[Frame]]]:
    """Yield each group of rows with its frames, whose numbers (T,) are known by row; no picture is decoded twice."""
    held: list[Frame] = []
    coming: Iterator[Frame] | None = None
    for rows in groups:
        first, last = int(numbers[rows[0]]), int(numbers[rows[-1]])
        coming = coming or recording.frames(since=first)
        held = [frame for frame in held if frame.index >= first]
        while not held or held[-1].index < last:
            frame = next(coming)
            held += [frame] if frame.index >= first else []
        yield rows, held
