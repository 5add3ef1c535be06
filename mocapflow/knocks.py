"""Cameras that were knocked while they filmed, and frames as if they had not been."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.geometry.turned import as_seen, points_seen
from mocapflow.records import F64, I16, I32, U8, Bool, array, record


@record
class Knocks:
    """From which frames on cameras have stood otherwise."""

    frame: I32 = array("K", unit="frame index, ascending")
    camera: I16 = array("K", unit="camera index")
    turn: F64 = array("K", 3, 3, unit="homography from pixels of the camera's first picture to those since")

    def undone(self, frame: Frame) -> Frame:
        """Return a frame as cameras that still stand as in the beginning would have seen it.

        What is said to be hidden is hidden in both places: moved back with what covers the lens now, and where painted
        furniture stood in the beginning.
        """
        since = self.frame <= frame.index
        turns = dict(zip(self.camera[since].tolist(), self.turn[since], strict=True))  # the last one of each
        if not turns:
            return frame
        images = list(frame.images)
        hidden = list(frame.hidden) or [np.zeros(image.shape[:2], bool) for image in images]
        people = list(frame.keypoints or [])
        for camera, turn in turns.items():
            back = np.linalg.inv(turn)
            images[camera], moved = _moved(images[camera], hidden[camera], back)
            hidden[camera] = hidden[camera] | moved
            if people:
                people[camera] = points_seen(people[camera], back)
        return replace(frame, images=tuple(images), hidden=tuple(hidden), keypoints=tuple(people) or None)


def _moved(image: U8, hidden: Bool, turn: F64) -> tuple[U8, Bool]:
    """Return an image (H, W, 3) and where (H, W) it shows nothing, as a camera that has turned sees it."""
    seen, known = as_seen(image, turn)
    covered, _ = as_seen(hidden.astype(np.uint8) * 255, turn)
    return seen, ~known | (covered > 0)
