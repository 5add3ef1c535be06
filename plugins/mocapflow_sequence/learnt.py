"""What pictures of a recording tell of the empty scene in one view."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mocapflow.data import Frame
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, U8, Bool
from mocapflow_sequence.colours import DEEP, Colours, alike, every, shaded

LEAST_SHARE = 0.06  # of the pictures that has to show a colour


class Learnt(NamedTuple):
    """The empty scene in one view, in grey levels."""

    mean: F32  # (H, W, 3)
    spread: F32  # (H, W, 3) standard deviation, inf where nobody knows

    @property
    def known(self) -> Bool:
        """Where (H, W) somebody knows."""
        return np.asarray(np.isfinite(self.spread[..., 0]))

    def take(self, colour: Colours, where: Bool) -> None:
        """Put a colour into what is learnt, in place."""
        self.mean[where], self.spread[where] = colour.mean[where], colour.spread[where]


def shown(picture: U8, usual: F32, nobody: Bool | None = None) -> Colours:
    """Return the colours of one picture, as noisy (3,) as is usual; none where (H, W) somebody is."""
    share = np.ones(picture.shape[:2], np.float32) if nobody is None else nobody.astype(np.float32)
    return Colours(picture.astype(np.float32), np.broadcast_to(usual, picture.shape), share)


def brightest(dim: Learnt, pictures: Iterable[tuple[Colours, Bool]]) -> Learnt:
    """Return an empty scene as bright as any picture shows it, for the person may shade it most of the time.

    Args:
        dim: how it is mostly shown.
        pictures: each with where (H, W) it may show the empty scene.
    """
    found = Learnt(dim.mean.copy(), dim.spread.copy())
    for colour, may in pictures:
        brighter = every(colour.mean > found.mean) & ~alike(colour, found.mean)
        found.take(colour, brighter & shaded(colour.mean, dim.mean, DEEP) & may)
    return found


def spread_out(recording: Recording, camera: int, among: range, samples: int) -> Iterator[Frame]:
    """Yield the frames of one camera that can be read, at most `samples`, evenly spread over some of the videos'."""
    step = max(len(among) // samples, 1)
    read = among[step // 2 :: step]  # evenly, but up to twice as many as are kept
    kept = {read[round(row)] for row in np.linspace(0, len(read) - 1, samples)}
    for frame in replace(recording.seen_by(camera), indices=read).frames():
        if frame.usable[0] and frame.index in kept:
            yield frame
