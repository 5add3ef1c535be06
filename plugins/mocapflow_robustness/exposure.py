"""Stage `exposure`: pictures of one recording become as bright and as rich in contrast as others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.io.lenses import toned
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8

Level = Annotated[float, Field(ge=0, le=255)]
Factor = Annotated[float, Field(ge=1)]

DARK, BRIGHT = 1, 95  # % of the pixels that are darker than what counts as the dark and the bright parts of a picture
THIN = 8  # every so many-th pixel tells
FIRST = 10  # frames of the videos that tell how a camera is set, whichever frames a run has
LIT = 30  # grey levels; darker pixels don't tell by how much a picture is brighter than another


class Exposure(Stage):
    """Corrects cameras that are set badly, and those whose brightness changes.

    What tells a person from the room is said in shares of the range of grey levels, as well exposed pictures use it. A
    camera that shows all too dark, through haze or in one colour has the levels of frames and plates spread, alike in
    all pictures; well set ones stay as they are. A frame that is brighter or darker than the first one all over, for
    the sun comes out or a camera sets itself, becomes as bright as that.
    """

    name: ClassVar[str] = "exposure"
    bright: Annotated[float, Field(gt=0, le=255)] = 215.0  # grey level that the bright parts of a picture should have
    dark: Level = 40.0  # likewise, of its dark parts, where there is haze
    darker: Factor = 1.25  # than that by this factor, and the camera is set too dark
    haze: Level = 75.0  # grey level of the dark parts from which on there is haze
    cast: Factor = 2.0  # ratio of the brightest to the darkest of the colours from which on a picture is tinged
    most: Factor = 5.0  # factor of grey levels at most: more shows noise
    steady: Annotated[float, Field(ge=0, lt=1)] = 0.02  # change of brightness, as a share, that frames may keep

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks corrected."""
        first = list(replace(recording, indices=recording.indices[:FIRST]).frames())
        cameras = list(zip(*(frame.images for frame in first), strict=True))
        tones = [self.tone(np.max([levels(image) for image in images], axis=0)) for images in cameras]
        views = tuple(
            view if tone is None else replace(view, tone=tone)
            for view, tone in zip(recording.views, tones, strict=True)
        )
        lit = [max(images, key=lambda image: float(image.mean())) for images in cameras]
        shown = [image if tone is None else toned(image, tone) for image, tone in zip(lit, tones, strict=True)]
        names = (view.lens.name for view in views)
        steady = Steadied(self.steady, dict(zip(names, map(thinned, shown), strict=True)))
        return replace(recording, views=views, changes=(*recording.changes, steady))

    def tone(self, levels: F64) -> U8 | None:
        """Return what grey levels become (256, 3) by dark and bright parts (2, 3) of pictures; None: the same."""
        black, white = levels[0].min(), levels[1].max()
        hazy, tinged = black > self.haze, white > self.cast * levels[1].min()
        if white * self.darker > self.bright and not hazy and not tinged:
            return None
        offset = max(black - self.dark, 0.0) if hazy else 0.0
        shown = levels[1] if tinged else np.full(3, white)
        gain = np.clip(self.bright / np.maximum(shown - offset, 1), None, self.most)
        return np.clip(np.rint((np.arange(256)[:, None] - offset) * gain), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Steadied:
    """Frames as bright, in each colour, as a first one, of which every so many-th pixel (h, w, 3) is known."""

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
        return toned(image, np.clip(np.rint(np.arange(256)[:, None] / gain), 0, 255).astype(np.uint8))


def brighter(image: U8, first: U8) -> F64 | None:
    """Return by which factors (3,) most pixels of an image (h, w, 3) are brighter than those of another; None: dark."""
    lit = ((image >= LIT) & (first >= LIT) & (image < 255) & (first < 255)).all(axis=2)
    if lit.mean() < 0.1:
        return None
    return np.asarray(np.median(image[lit] / first[lit].astype(float), axis=0), float)


def levels(image: U8) -> F64:
    """Return the grey levels (2, 3) of the dark and the bright parts of an image (H, W, 3) in each colour."""
    return np.asarray(np.percentile(thinned(image).reshape(-1, 3), (DARK, BRIGHT), axis=0), float)


def thinned(image: U8) -> U8:
    """Return every so many-th pixel (h, w, 3) of an image (H, W, 3)."""
    return np.ascontiguousarray(image[::THIN, ::THIN])
