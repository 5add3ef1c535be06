"""Stage `calm`: takes out of the pictures what holds for a pixel or for a moment only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, field_validator

from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.recording import Recording
from mocapflow.records import U8


class Calm(Stage):
    """A median over the neighbours of each pixel, then over the frame before, the frame and the one after.

    For noise that replaces pixels, and for what flies past a camera. An edge that moves on from frame to frame stays
    where it is in the middle one; what is thinner than it moves in a frame is lost.
    """

    name: ClassVar[str] = "calm"
    width_px: Annotated[int, Field(ge=0)] = 9  # of the pixels' neighbourhood, odd; 0: none
    across_time: bool = True  # the median of three frames

    @field_validator("width_px")
    @classmethod
    def _odd(cls, width: int) -> int:
        if width and width % 2 == 0:
            raise ValueError("an odd number, so that there is a middle")
        return width

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks when calmed."""
        return replace(recording, changes=(*recording.changes, Medians(self)))


@dataclass(frozen=True)
class Medians:
    """Frames filtered by the settings of a stage."""

    settings: Calm

    def frames(self, source: Recording, indices: range) -> Iterator[Frame]:
        """Yield the filtered frames; each asks for its neighbours in the recording, whichever frames are wanted."""
        if not self.settings.across_time:
            yield from map(self._filtered, replace(source, indices=indices).frames())
            return
        # at its ends the recording has no neighbour on one side: there the next but one takes the place
        first, last = max(min(indices[0], source.length - 2) - 1, 0), min(max(indices[-1], 1) + 2, source.length)
        window: list[Frame] = []
        for frame in map(self._filtered, replace(source, indices=range(first, last)).frames()):
            window = [*window[-2:], frame]
            if len(window) == 3:
                ends = (first == 0 and frame.index == 2, True, frame.index == source.length - 1)
                wanted = [k for k, end in enumerate(ends) if end and window[k].index in indices]
                yield from (in_time(window, k) for k in wanted)
        if len(window) < 3:  # a recording of one or two frames
            yield from (frame for frame in window if frame.index in indices)

    def _filtered(self, frame: Frame) -> Frame:
        import cv2

        width = self.settings.width_px
        if width <= 1:
            return frame
        return replace(frame, images=tuple(np.asarray(cv2.medianBlur(i, width), np.uint8) for i in frame.images))


def in_time(window: Sequence[Frame], which: int) -> Frame:
    """Return one of three frames with the median of all three for pictures, in views that all three have."""
    all_three = np.all([frame.usable for frame in window], axis=0)
    images = [
        middle(*views) if usable else views[which]
        for views, usable in zip(zip(*(frame.images for frame in window), strict=True), all_three, strict=True)
    ]
    return replace(window[which], images=tuple(images))


def middle(one: U8, two: U8, three: U8) -> U8:
    """Return the median of three pictures, value by value."""
    return np.maximum(np.minimum(one, two), np.minimum(np.maximum(one, two), three))
