"""Frames become as bright as a typical one of their camera, all over or from one side to the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.io.cameras.views import with_levels
from mocapflow.io.recording.plates import blocks
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8, Bool

ACROSS = 40  # blocks of a picture, whose brightness is compared: a pixel alone is noisy
DARK = 30  # grey levels; darker blocks don't tell by how much a picture is brighter than another
TELLING = 0.1  # share of the blocks that have to tell
ALIKE = 0.05  # median share by which the factors of blocks may differ: those of one room differ by 0.01
FARTHEST = 2.5  # times the median by which factors may be off a light that changes across a picture: others are people
FITS = 8  # of such a light to the blocks that agree with the last one


@dataclass(frozen=True)
class NormalisedBrightness:
    """Frames as bright, in each colour, as a typical one of their camera."""

    tolerance: float  # share by which they may differ
    typical: Mapping[str, U8]  # blocks (h, w, 3) of that picture, by camera

    def frames(self, source: Recording) -> Iterator[Frame]:
        """Yield the normalised frames."""
        typical = [self.typical.get(view.lens.name) for view in source.views]
        for frame in source.frames():
            images = (self.image(image, usual) for image, usual in zip(frame.images, typical, strict=True))
            yield replace(frame, images=tuple(images))

    def image(self, image: U8, typical: U8 | None) -> U8:
        """Return an image (H, W, 3) as bright as a typical one, if that is known and of the same room."""
        gain = None if typical is None else relative_gain(block_means(image), typical)
        if gain is None or np.all(np.abs(gain - 1) <= self.tolerance):
            return image
        return with_levels(image, multiplied(1 / gain)) if gain.ndim == 1 else divided(image, gain)


def relative_gain(image: U8, typical: U8) -> F64 | None:
    """Return by which factors the blocks (h, w, 3) of a picture are brighter, (3,) or (h, w, 3); None: nobody can tell.

    One factor of each colour is that of most blocks. Where a lamp went out or the sun has come in at one side, factors
    change across the picture, as polynomials of second order. Nobody can tell of black pictures, nor of those of
    different rooms, whose factors differ from block to block.
    """
    usable = np.asarray(((np.minimum(image, typical) >= DARK) & (np.maximum(image, typical) < 255)).all(axis=2))
    if usable.mean() < TELLING:
        return None
    factors = image[usable] / typical[usable].astype(float)
    everywhere = np.median(factors, axis=0)
    if _alike(factors / everywhere):
        return np.asarray(everywhere, float)
    across = _across(np.log(factors), usable)
    return across if _alike(factors / across[usable]) else None


def _alike(factors: F64) -> bool:
    """Return whether most factors (N, 3) are about one."""
    return bool(np.median(np.abs(factors - 1), axis=0).max() < ALIKE)


def _across(logs: F64, usable: Bool) -> F64:
    """Return factors (h, w, 3) by polynomials through the logarithms (N, 3) of those of some blocks, outliers apart.

    Where no block tells, they are within those where some do: polynomials know no bounds.
    """
    y, x = (np.linspace(-1, 1, count) for count in usable.shape)
    x, y = np.meshgrid(x, y)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    known, agree = terms[usable], np.ones(len(logs), bool)
    for _ in range(FITS):
        weights = np.linalg.lstsq(known[agree], logs[agree], rcond=None)[0]
        off = np.abs(logs - known @ weights).max(axis=1)
        agree = off <= FARTHEST * np.median(off)
    fitted = known[agree] @ weights
    return np.asarray(np.exp(np.clip(terms @ weights, fitted.min(axis=0), fitted.max(axis=0))))


def divided(image: U8, gain: F64) -> U8:
    """Return an image (H, W, 3) whose grey levels are divided by factors of its blocks (h, w, 3)."""
    import cv2

    height, width = image.shape[:2]
    smooth = cv2.resize(1 / gain, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.clip(np.rint(image * smooth), 0, 255), np.uint8)


def multiplied(gains: F64) -> U8:
    """Return what grey levels become (256, 3), each colour multiplied by its factor (3,)."""
    return np.clip(np.rint(np.arange(256)[:, None] * gains), 0, 255).astype(np.uint8)


def block_means(image: U8) -> U8:
    """Return the blocks (h, w, 3) of an image (H, W, 3), `ACROSS` of them side by side."""
    return blocks(image, max(image.shape[1] // ACROSS, 1))
