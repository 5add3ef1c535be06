"""Cameras that were knocked while they filmed, and frames as if they had not been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.geometry.camera_rotation import warped, warped_points
from mocapflow.records import F64, I16, I32, U8, Bool, array, record


@record
class Knocks:
    """From which frames on cameras have stood otherwise."""

    frame: I32 = array("K", unit="frame index, ascending")
    camera: I16 = array("K", unit="camera index")
    turn: F64 = array("K", 3, 3, unit="homography from pixels of the camera's first picture to those since")

    def undone(self, frame: Frame) -> Frame:
        """Return a frame as cameras that still stand as in the beginning would have seen it.

        Hidden pixels stay hidden in both places: moved back with the picture, as what covers the lens is, and where
        they were, as furniture that was painted at the beginning is.
        """
        ways = self._back(frame.index)
        if not ways:
            return frame
        images = list(frame.images)
        hidden = list(frame.hidden) or [np.zeros(image.shape[:2], bool) for image in images]
        for camera, back in ways.items():
            images[camera], moved = _moved(images[camera], hidden[camera], back)
            hidden[camera] = hidden[camera] | moved
        people = frame.keypoints and self.people(frame.index, frame.keypoints)
        return replace(frame, images=tuple(images), hidden=tuple(hidden), keypoints=people)

    def people(self, index: int, people: Sequence[F64]) -> tuple[F64, ...]:
        """Return the keypoints of a frame, per camera (N, K, 3) px, px, confidence, as such cameras would see them."""
        ways = self._back(index)
        return tuple(warped_points(p, ways[camera]) if camera in ways else p for camera, p in enumerate(people))

    def _back(self, index: int) -> dict[int, F64]:
        """Return the homographies (3, 3) that move pictures of a frame back, by camera."""
        since = self.frame <= index
        turns = dict(zip(self.camera[since].tolist(), self.turn[since], strict=True))  # the last one of each
        return {camera: np.linalg.inv(turn) for camera, turn in turns.items()}


def _moved(image: U8, hidden: Bool, turn: F64) -> tuple[U8, Bool]:
    """Return an image (H, W, 3) and where (H, W) it shows nothing, as a camera that has turned sees it."""
    seen, known = warped(image, turn)
    covered, _ = warped(hidden.astype(np.uint8) * 255, turn)
    return seen, ~known | (covered > 0)
