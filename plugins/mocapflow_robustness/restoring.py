"""Stages that restore spoiled pictures as they are read, each by its own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, U8, Bool
from mocapflow_robustness.occlusion import union


class Restorer(Stage):
    """A stage that knows how to restore one picture; the files are left alone."""

    @abstractmethod
    def restore(self, image: U8) -> tuple[U8, Bool]:
        """Return an image (H, W, 3) as it was, and where (H, W) it does not show the scene."""

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks restored."""
        return replace(recording, changes=(*recording.changes, Restored(self)))


@dataclass(frozen=True)
class Restored:
    """Frames restored by a stage."""

    restorer: Restorer

    def frames(self, source: Recording) -> Iterator[Frame]:
        """Yield the restored frames."""
        for frame in source.frames():
            images, hidden = zip(*(self.restorer.restore(image) for image in frame.images), strict=True)
            yield replace(frame, images=images, hidden=union(frame.hidden, hidden))


def mean_around(image: U8, known: Bool, sigma_px: float) -> tuple[F32, F32]:
    """Return the mean (H, W, 3) of `known` pixels (H, W) under a Gaussian window, and their share (H, W) of that."""
    import cv2

    weight = known.astype(np.float32)
    total = np.asarray(cv2.GaussianBlur(weight, (0, 0), sigma_px), np.float32)
    blurred = cv2.GaussianBlur(image * weight[..., None], (0, 0), sigma_px)
    return np.asarray(blurred / np.maximum(total, 1e-12)[..., None], np.float32), total
