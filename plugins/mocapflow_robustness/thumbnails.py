"""Every picture of a recording, so small and blurred that a limb's motion from frame to frame hardly changes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mocapflow.data import Frame
from mocapflow.recordings.freezing import difference
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, F64, U8, Bool, array, record

SIDE = 20  # px of a thumbnail; blurred like this, pictures differ in proportion to how far things have moved
BLUR = 1.5  # px of a thumbnail


@record
class Thumbnails:
    """T frames of C cameras."""

    grey: F32 = array("T", "C", SIDE, SIDE, unit="grey levels")
    change: F64 = array("T", "C", unit="grey levels, mean absolute difference to the picture before; NaN without one")
    usable: Bool = array("T", "C", unit="False where there is no picture")


def thumbnails(recording: Recording, look: Callable[[Frame], None] = lambda frame: None) -> Thumbnails:
    """Return the thumbnails of all frames of a recording; each is shown to `look`, as videos are decoded only once."""
    everything = replace(recording, indices=range(recording.length))
    grey = np.zeros((recording.length, len(recording.views), SIDE, SIDE), np.float32)
    change, usable = np.full(grey.shape[:2], np.nan), np.zeros(grey.shape[:2], bool)
    before: list[U8 | None] = [None] * len(recording.views)
    for row, frame in enumerate(everything.frames()):
        look(frame)
        usable[row] = frame.usable
        for camera in np.flatnonzero(frame.usable):
            image, last = frame.images[camera], before[camera]
            grey[row, camera] = thumbnail(image)
            if last is not None:
                change[row, camera] = difference(image, last)
            before[camera] = image
    return Thumbnails(grey=grey, change=change, usable=usable)


def thumbnail(image: U8) -> F32:
    """Return a picture (H, W, 3) as a small grey one, blurred."""
    import cv2

    small = cv2.cvtColor(cv2.resize(image, (SIDE, SIDE), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.GaussianBlur(small.astype(np.float32), (0, 0), BLUR), np.float32)
