"""Frames become as bright as a typical one of their camera."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.io.lenses import with_levels
from mocapflow.io.plates import blocks
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8

ACROSS = 40  # blocks of a picture, whose brightness is compared: a pixel alone is noisy
DARK = 30  # grey levels; darker blocks don't tell by how much a picture is brighter than another
TELLING = 0.1  # share of the blocks that have to tell
ALIKE = 0.05  # median share by which the factors of blocks may differ: those of one room differ by 0.01


@dataclass(frozen=True)
class Steadied:
    """Frames as bright, in each colour, as a typical one of their camera."""

    tolerance: float  # share by which they may differ
    typical: Mapping[str, U8]  # blocks (h, w, 3) of that picture, by camera

    def frames(self, source: Recording, indices: range) -> Iterator[Frame]:
        """Yield the steadied frames."""
        typical = [self.typical.get(view.lens.name) for view in source.views]
        for frame in replace(source, indices=indices).frames():
            images = (self.image(image, usual) for image, usual in zip(frame.images, typical, strict=True))
            yield replace(frame, images=tuple(images))

    def image(self, image: U8, typical: U8 | None) -> U8:
        """Return an image (H, W, 3) as bright as a typical one, if that is known and of the same room."""
        gain = None if typical is None else brighter(small(image), typical)
        if gain is None or np.all(np.abs(gain - 1) <= self.tolerance):
            return image
        return with_levels(image, multiplied(1 / gain))


def brighter(image: U8, typical: U8) -> F64 | None:
    """Return by which factors (3,) the blocks (h, w, 3) of a picture are brighter, most of them; None: nobody can tell.

    Nobody can of black pictures, nor of those of different rooms, whose factors differ from block to block.
    """
    told = ((np.minimum(image, typical) >= DARK) & (np.maximum(image, typical) < 255)).all(axis=2)
    if told.mean() < TELLING:
        return None
    factors = image[told] / typical[told].astype(float)
    gain = np.median(factors, axis=0)
    alike = np.median(np.abs(factors / gain - 1), axis=0).max() < ALIKE
    return np.asarray(gain, float) if alike else None


def multiplied(gains: F64) -> U8:
    """Return what grey levels become (256, 3), each colour multiplied by its factor (3,)."""
    return np.clip(np.rint(np.arange(256)[:, None] * gains), 0, 255).astype(np.uint8)


def small(image: U8) -> U8:
    """Return the blocks (h, w, 3) of an image (H, W, 3), `ACROSS` of them side by side."""
    return blocks(image, max(image.shape[1] // ACROSS, 1))
