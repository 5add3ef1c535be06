"""Stage `exposure`: pictures that are too dark, tinged, or not always as bright are set right."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.io.lenses import View, toned
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8

LOG = logging.getLogger("mocapflow")
Factor = Annotated[float, Field(ge=1)]

BRIGHT = 95  # % of the pixels that are darker than what counts as the bright parts of a picture
PIXELS = 40  # of a row that are looked at, and as many of a column of that height
FIRST = 10  # frames of the videos that tell how a camera is set, whichever frames a run has
LIT = 30  # grey levels; darker pixels don't tell by how much a picture is brighter than another
LEAST = 0.1  # share of the pixels that have to tell
WHITE = 0.1  # share of pictures in which a colour is at the end of its range, from which on a camera is overexposed
ALIKE = 0.05  # median share by which factors of pixels may differ: those of one room differ by 0.01


class Exposure(Stage):
    """Corrects cameras that are set badly, and those whose brightness changes.

    What tells a person from the room is said in shares of the range of grey levels, as well exposed pictures use it.
    So the frames and plates of a camera that shows all too dark or in one colour are brightened, all by the same
    factors; well set ones stay as they are. A frame that is brighter or darker than the first ones all over, for the
    sun comes out or a camera sets itself, becomes as bright as they.
    """

    name: ClassVar[str] = "exposure"
    bright: Annotated[float, Field(gt=0, le=255)] = 215.0  # grey level that the bright parts of a picture should have
    darker: Factor = 1.25  # than that by this factor, and the camera is set too dark
    cast: Factor = 2.0  # ratio of the brightest to the darkest of the colours from which on a picture is tinged
    most: Factor = 5.0  # factor of grey levels at most: more shows noise
    steady: Annotated[float, Field(ge=0, lt=1)] = 0.02  # change of brightness, as a share, that frames may keep

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks corrected."""
        beginning = replace(recording, indices=recording.indices[:FIRST]).frames()
        cameras = list(zip(*(map(thinned, frame.images) for frame in beginning), strict=True))
        views = tuple(map(self._corrected, recording.views, cameras))
        first = {view.lens.name: toned(lit(images), view.tone) for view, images in zip(views, cameras, strict=True)}
        return replace(recording, views=views, changes=(*recording.changes, Steadied(self.steady, first)))

    def _corrected(self, view: View, images: Sequence[U8]) -> View:
        """Return the view of a camera that is set right, and warn of what was wrong."""
        name, white = view.lens.name, np.mean([(image == 255).any(axis=2).mean() for image in images])
        if white > WHITE:
            LOG.warning(f"{name} is overexposed, {white:.0%} of its pictures: a shadow there may pass for the person")
        gains = self.gains(np.max([brightness(image) for image in images], axis=0))
        if gains is None:
            return view
        blue, green, red = gains
        LOG.warning(
            f"{name} is too dark or tinged: blue {blue:.2g}, green {green:.2g}, red {red:.2g} times as bright now"
        )
        return replace(view, tone=table(gains))

    def gains(self, bright: F64) -> F64 | None:
        """Return the factors (3,) for a camera whose bright parts have these grey levels (3,), None for a good one."""
        most = bright.max()
        tinged = most > self.cast * bright.min()
        if most * self.darker > self.bright and not tinged:
            return None
        gain = self.bright / np.maximum(bright if tinged else most, 1)
        return np.broadcast_to(np.minimum(gain, self.most), 3)


@dataclass(frozen=True)
class Steadied:
    """Frames as bright, in each colour, as a first one, of which some pixels (h, w, 3) are known."""

    steady: float  # share by which they may differ
    first: Mapping[str, U8]  # by camera

    def frames(self, source: Recording, indices: range) -> Iterator[Frame]:
        """Yield the steadied frames."""
        first = [self.first[view.lens.name] for view in source.views]
        for frame in replace(source, indices=indices).frames():
            images = (self.image(image, thin) for image, thin in zip(frame.images, first, strict=True))
            yield replace(frame, images=tuple(images))

    def image(self, image: U8, first: U8) -> U8:
        """Return an image (H, W, 3) as bright as the first one; one of another room, or black, stays."""
        gain = brighter(thinned(image), first)
        if gain is None or np.all(np.abs(gain - 1) <= self.steady):
            return image
        return toned(image, table(1 / gain))


def brighter(image: U8, first: U8) -> F64 | None:
    """Return by which factors (3,) an image (h, w, 3) is brighter than another, by most of it; None: nobody can tell.

    Nobody can of black pictures, nor of those of different rooms, whose factors differ from pixel to pixel.
    """
    told = ((np.minimum(image, first) >= LIT) & (np.maximum(image, first) < 255)).all(axis=2)
    if told.mean() < LEAST:
        return None
    factors = image[told] / first[told].astype(float)
    gain = np.median(factors, axis=0)
    alike = np.median(np.abs(factors / gain - 1), axis=0).max() < ALIKE
    return np.asarray(gain, float) if alike else None


def lit(images: Sequence[U8]) -> U8:
    """Return the first of some pictures (H, W, 3) that is no black one."""
    means = np.array([image.mean() for image in images])
    return images[int(np.argmax(means >= 0.5 * means.max()))]


def brightness(image: U8) -> F64:
    """Return the grey levels (3,) of the bright parts of an image (H, W, 3), colour by colour."""
    return np.asarray(np.percentile(image, BRIGHT, axis=(0, 1)), float)


def table(gain: F64) -> U8:
    """Return what grey levels become (256, 3), brightened by factors (3,)."""
    return np.clip(np.rint(np.arange(256)[:, None] * gain), 0, 255).astype(np.uint8)


def thinned(image: U8) -> U8:
    """Return every so many-th pixel (h, w, 3) of an image (H, W, 3)."""
    step = max(image.shape[1] // PIXELS, 1)
    return np.ascontiguousarray(image[::step, ::step])
