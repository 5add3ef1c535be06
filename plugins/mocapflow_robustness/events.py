"""What can happen to the frames of a camera, for a while or for good."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveInt

from mocapflow.assets import Camera
from mocapflow.geometry.camera_rotation import homography
from mocapflow.records import F64
from mocapflow.settings import Settings


class Event(Settings):
    """Something that happens to some cameras over some frames."""

    what: Literal[
        "black", "torn", "covered", "frozen", "late", "other_time", "other_camera", "dropped", "knocked"
    ]  # to the pictures
    first: NonNegativeInt = 0  # first frame
    count: PositiveInt | None = None  # number of frames; none: for good
    views: tuple[str, ...] = ()  # names of cameras; none: all of them
    by: PositiveInt = 3  # late: number of frames; other_time: so many frames ahead, or back where there are none
    turn_deg: float = 0.5  # knocked: how far the camera turns to its right
    share: Annotated[float, Field(gt=0, le=1)] = 0.5  # covered, and known to be: the lower part, share of the height

    def holds(self, index: int, view: str) -> bool:
        """Return whether it happens to a frame of a view."""
        last = index if self.count is None else self.first + self.count - 1
        return self.first <= index <= last and (not self.views or view in self.views)

    def first_covered(self, height: int) -> int:
        """Return the first row that is covered, in a picture so high."""
        return round(height * (1 - self.share))

    def homography(self, camera: Camera) -> F64:
        """Return how pixels (3, 3) of a camera move that is knocked."""
        angle = np.radians(self.turn_deg)
        to_the_left = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
        return homography(to_the_left, camera)  # of what it sees

    def source(self, index: int, length: int) -> int:
        """Return which frame, of `length`, stands in the place of a frame."""
        stop = self.first + self.count if self.count else index + 1
        wanted = {
            "frozen": self.first - 1,
            "late": index - self.by,
            "other_time": index + self.by if stop + self.by <= length else index - self.by,
        }.get(self.what, index)
        return max(wanted, 0)
