"""Stage `exposure`: pictures that are too dark, tinged, or not always as bright are set right."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.components import Stage
from mocapflow.errors import PipelineError
from mocapflow.io.cameras.views import View, with_levels
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8
from mocapflow_robustness.brightness import NormalisedBrightness, block_means, multiplied

LOG = logging.getLogger("mocapflow")
Factor = Annotated[float, Field(ge=1)]

FIRST = 10  # frames of the videos that tell how a camera is set, whichever frames a run has
BRIGHT, BRIGHTEST = 95, 99.5  # % of the pixels that are darker than the bright parts of a picture, than nearly all
STEP = 8  # px between the pixels that tell of a picture's levels
WHITE = 0.1  # share of the pixels with a colour at the end of its range, from which on a camera is overexposed
BLACK = 30  # grey level; a picture without a brighter pixel shows nothing


class Exposure(Stage):
    """Corrects cameras that are set badly, and pictures that are not as bright as others of their camera.

    What tells a person from the room is stated in shares of the range of grey levels, which well exposed pictures fill.
    So if a camera shows everything too dark, or tinged, the levels of each colour are multiplied by one factor in all
    its frames and plates, as far as the brightest parts allow; other cameras keep theirs. A frame that is brighter or
    darker than the first ones, all over or more at one side (the sun comes out, a lamp goes out, a camera adjusts
    itself), is made as bright as they are. The stage has to stand before all stages that change pictures.
    """

    name: ClassVar[str] = "exposure"
    bright: Annotated[float, Field(gt=0, le=255)] = 215.0  # grey level that the bright parts of a picture should have
    least_gain: Factor = 1.25  # smallest factor of grey levels that is worth a correction
    most_gain: Factor = 5.0  # largest factor: more shows noise
    tinged: Factor = 2.0  # ratio of the brightest to the darkest colour of the bright parts: more is a tinge
    tolerance: Annotated[float, Field(ge=0, lt=1)] = 0.02  # share by which a frame may be brighter or darker

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks corrected.

        Raises:
            PipelineError: a stage before changes pictures.
        """
        if recording.changes:
            hint = "put it before the stages that change pictures, as `corrupt` and `denoise` do"
            raise PipelineError("the stage 'exposure' sets cameras right, and pictures were changed already", hint=hint)
        usual = typical(recording)
        views = tuple(self._corrected(view, usual.get(view.lens.name)) for view in recording.views)
        levels = {view.lens.name: view.levels for view in views}
        shown = {name: block_means(with_levels(image, levels[name])) for name, image in usual.items()}
        return replace(recording, views=views, changes=(NormalisedBrightness(self.tolerance, shown),))

    def _corrected(self, view: View, image: U8 | None) -> View:
        """Return the view of a camera set right by a picture (H, W, 3) of it, if any, and warn of what was wrong."""
        if image is None:
            return view
        name, pixels = view.lens.name, image[::STEP, ::STEP]
        white = float((pixels == 255).any(axis=2).mean())
        if white > WHITE:
            LOG.warning(f"{name} is overexposed, {white:.0%} of its picture: a shadow there may pass for the person")
        gains = self.gains(*np.percentile(pixels, (BRIGHT, BRIGHTEST), axis=(0, 1)))
        if gains is None:
            return view
        wrong, (blue, green, red) = "tinged" if np.ptp(gains) else "too dark", gains
        LOG.warning(f"{name} is {wrong}: blue {blue:.2g}, green {green:.2g}, red {red:.2g} times as bright now")
        return replace(view, levels=multiplied(gains))

    def gains(self, bright: F64, brightest: F64) -> F64 | None:
        """Return factors (3,) of the levels of the colours, None where they stay.

        Args:
            bright: (3,) grey levels of the bright parts, by colour.
            brightest: (3,) those that hardly any pixel exceeds: they stay within the range.
        """
        if bright.max() <= self.tinged * bright.min():
            bright, brightest = np.full(3, bright.max()), np.full(3, brightest.max())
        gains = np.minimum(self.bright / np.maximum(bright, 1), 255 / np.maximum(brightest, 1))
        gains = np.clip(gains, 1, self.most_gain)
        return gains if gains.max() >= self.least_gain else None


def typical(recording: Recording) -> dict[str, U8]:
    """Return, by camera, the picture (H, W, 3) of median brightness of those first ones that show anything."""
    first = replace(recording, indices=range(min(FIRST, recording.length)))
    shown: dict[str, list[U8]] = {}
    for frame in first.frames():
        for camera in np.flatnonzero(frame.usable):
            if frame.images[camera].max() > BLACK:
                shown.setdefault(recording.views[camera].lens.name, []).append(frame.images[camera])
    return {name: _median(images) for name, images in shown.items()}


def _median(images: Sequence[U8]) -> U8:
    return sorted(images, key=lambda image: float(image[::STEP, ::STEP].mean()))[len(images) // 2]
