"""Stage `background`: the empty scene, from clean plates or as the median over the recording."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.recording import Recording
from mocapflow.records import F32, U8, Bool

ROWS = 64  # of the images at a time: the median's working memory
LEAST_SPREAD = 1.0  # grey levels; the rounding of 8-bit pictures alone makes 0.3
SAME = 8  # grey levels, over all samples
UNLIKE = 20.0  # grey levels from the plate
OPENED, WIDENED = 5, 11  # px: smaller occluders are noise; around them pictures are mixed
NORMAL = 1.4826  # standard deviation of a normal variable over its median absolute deviation


class EmptyScene(Stage):
    """Learns what the cameras see without the person.

    Without clean plates it takes the median over frames spread evenly over the whole recording, whichever frames
    are tracked: right wherever the person stands less than half of the time. Memory is bounded by `samples`
    pictures of one camera.
    """

    name: ClassVar[str] = "background"
    source: Literal["auto", "plates", "median"] = "auto"  # auto: the plates where there are any
    samples: Annotated[int, Field(ge=3)] = 25  # frames the median is taken over
    adapt: bool = False  # with plates: to the recording's noise, and to what stands before the person in all of it

    def run(self, recording: Recording) -> Background:
        """Return mean and spread of every pixel of the empty scene.

        Raises:
            RecordingError: plates are wanted and missing, or a camera has too few readable frames for a median.
        """
        plates = None if self.source == "median" else recording.background()
        if plates is not None:
            return self._adapted(plates, recording) if self.adapt else plates
        if self.source == "plates":
            raise RecordingError(
                "there are no clean plates",
                where=str(recording.folder / "background"),
                hint="put one picture per camera there (cam01.png …), or set source: median",
            )
        pairs = [temporal_median(self._pictures(recording, c)) for c in range(len(recording.views))]
        return Background(mean=tuple(mean for mean, _ in pairs), spread=tuple(spread for _, spread in pairs))

    def _adapted(self, plates: Background, recording: Recording) -> Background:
        mean, spread, hidden = [], [], []
        for camera, plate in enumerate(plates.mean):
            pictures = self._pictures(recording, camera)
            usual, noise = as_shown(pictures, plate)
            mean.append(usual)
            spread.append(np.maximum(plates.spread[camera], noise).astype(np.float32))
            hidden.append(unmoved(pictures, plate))
        return Background(mean=tuple(mean), spread=tuple(spread), hidden=tuple(hidden))

    def _pictures(self, recording: Recording, camera: int) -> U8:
        """Return pictures (N, H, W, 3) of one camera, spread over the recording."""
        step = max(recording.length // self.samples, 1)
        sampled = replace(recording.seen_by(camera), indices=range(step // 2, recording.length, step))
        pictures = [frame.images[0] for frame in sampled.frames() if frame.usable[0]]
        if len(pictures) < 3:
            raise RecordingError(
                f"{recording.views[camera].lens.name} has {len(pictures)} readable frames, too few for a median",
                where=str(recording.folder),
                hint="give a clean plate in background/, or a longer recording",
            )
        return np.stack(pictures)


def as_shown(pictures: U8, plate: F32) -> tuple[F32, F32]:
    """Return the room as pictures (N, H, W, 3) show it, and their noise (3,) grey levels about it.

    Where their median is near the plate (H, W, 3) it takes its place: noise that replaces pixels, even when filtered,
    draws all colours towards grey. Elsewhere the person stood too long, or something stands before the room.
    """
    shown, _ = temporal_median(pictures)
    near = np.abs(shown - plate).max(axis=2, keepdims=True) < UNLIKE
    usual = np.where(near, shown, plate).astype(np.float32)
    each = [NORMAL * np.median(np.abs(picture - usual), axis=(0, 1)) for picture in pictures]
    return usual, np.median(each, axis=0).astype(np.float32)


def unmoved(pictures: U8, plate: F32) -> Bool:
    """Return where pictures (N, H, W, 3) all look the same and unlike the clean plate (H, W, 3): no person does."""
    import cv2

    same = (pictures.max(axis=0) - pictures.min(axis=0)).max(axis=2) <= SAME
    unlike = np.abs(pictures[0] - plate).max(axis=2) > UNLIKE
    whole = cv2.morphologyEx((same & unlike).astype(np.uint8), cv2.MORPH_OPEN, np.ones((OPENED, OPENED), np.uint8))
    return np.asarray(cv2.dilate(whole, np.ones((WIDENED, WIDENED), np.uint8)), bool)


def temporal_median(pictures: U8) -> tuple[F32, F32]:
    """Return the median (H, W, 3) of pictures (N, H, W, 3) and its robust spread, both in grey levels.

    The spread of a pixel is 1.4826 times its median absolute deviation, at least the median of that over the
    picture: a few frames say little about one pixel's noise.
    """
    mean, spread = np.empty(pictures.shape[1:], np.float32), np.empty(pictures.shape[1:], np.float32)
    for top in range(0, pictures.shape[1], ROWS):
        rows = pictures[:, top : top + ROWS].astype(np.float32)
        middle = np.median(rows, axis=0)
        mean[top : top + ROWS] = middle
        spread[top : top + ROWS] = NORMAL * np.median(np.abs(rows - middle), axis=0)
    usual = np.median(spread, axis=(0, 1))
    return mean, np.maximum(np.maximum(spread, usual), LEAST_SPREAD).astype(np.float32)
