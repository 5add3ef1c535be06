"""Stage `background`: the empty scene, from clean plates or as the median over the recording."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.io.plates import plate_files
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, U8

LOG = logging.getLogger("mocapflow")
ROWS = 64  # of the images at a time: the median's working memory
LEAST_SPREAD = 1.0  # grey levels; the rounding of 8-bit pictures alone makes 0.3
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

    def need(self, recording: Recording) -> None:
        """Raise if plates are wanted and missing."""
        found = self.source == "median" or plate_files(recording.folder, recording.views)
        if self.source == "plates" and not found:
            raise RecordingError(
                "there are no clean plates",
                where=str(recording.folder / "background"),
                hint="put one picture per camera there (cam01.png …), or set source: median",
            )

    def run(self, recording: Recording) -> Background:
        """Return mean and spread of every pixel of the empty scene.

        Raises:
            RecordingError: plates are wanted and missing, or a camera has too few readable frames for a median.
        """
        self.need(recording)
        plates = None if self.source == "median" else recording.background()
        if plates is not None:
            return plates
        if self.source == "auto":
            LOG.warning(
                "no clean plates in %s: a median over the recording stands in for them; a person who stays in place"
                " is part of it",
                recording.folder / "background",
            )
        pairs = [temporal_median(self._pictures(recording, c)) for c in range(len(recording.views))]
        mean, spread = zip(*pairs, strict=True)
        return Background(mean=mean, spread=spread, assumed=True)

    def _pictures(self, recording: Recording, camera: int) -> U8:
        """Return pictures (N, H, W, 3) of one camera, spread over the recording."""
        step = max(recording.length // self.samples, 1)
        read = range(step // 2, recording.length, step)  # evenly, but up to twice as many as are kept
        kept = {read[round(row)] for row in np.linspace(0, len(read) - 1, self.samples)}
        sampled = replace(recording.seen_by(camera), indices=read)
        pictures = [frame.images[0] for frame in sampled.frames() if frame.usable[0] and frame.index in kept]
        if len(pictures) < 3:
            raise RecordingError(
                f"{recording.views[camera].lens.name} has {len(pictures)} readable frames, too few for a median",
                where=str(recording.folder),
                hint="give a clean plate in background/, or a longer recording",
            )
        return np.stack(pictures)


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
