"""Stage `exposure`: brightens what is too dark."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.components import Stage
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, U8

BRIGHT = 95  # % of the pixels that are darker than what counts as the bright parts of a picture
THIN = 4  # every so many-th pixel tells
FIRST = 10  # frames of the videos that are looked at, whichever a run begins with


class Exposure(Stage):
    """Brightens the frames and plates of each camera that is underexposed, all of them by one factor.

    What tells a person from a room is said in shares of the range of grey levels, as well exposed pictures use it.
    The brightest of the first frames tells, for many a camera begins with black ones. A camera that is dark but for
    a lamp in its picture stays as it is, as does one that is well exposed.
    """

    name: ClassVar[str] = "exposure"
    bright: Annotated[float, Field(gt=0, le=255)] = 215.0  # grey level that the bright parts of a picture should have
    least: Annotated[float, Field(ge=1)] = 1.25  # factor below which a camera is well exposed
    most: Annotated[float, Field(ge=1)] = 5.0  # factor at most: more shows noise

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks brightened."""
        first = replace(recording, indices=recording.indices[:FIRST])
        levels = np.max([[brightness(image) for image in frame.images] for frame in first.frames()], axis=0)
        views = zip(recording.views, self.gains(levels), strict=True)
        return replace(recording, views=tuple(replace(view, gain=view.gain * gain) for view, gain in views))

    def gains(self, levels: F64) -> list[float]:
        """Return the factors for cameras whose bright parts have these grey levels (C,)."""
        wanted = np.minimum(self.bright / np.maximum(levels, 1), self.most)
        return [float(gain) for gain in np.where(wanted < self.least, 1.0, wanted)]


def brightness(image: U8) -> float:
    """Return the grey level of the bright parts of an image (H, W, 3), in the brightest of its colours."""
    return float(np.percentile(image[::THIN, ::THIN].max(axis=2), BRIGHT))
