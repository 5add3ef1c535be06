"""Stage `hysteresis`: what hardly differs from the empty scene becomes the empty scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, U8, Bool

LOW = 3.3  # spreads of the empty scene, over all colours together; chance exceeds it at 1 %
HIGH = 6.0  # the same, somewhere in a place that stays as it is


class Hysteresis(Stage):
    """Clears restored pictures of what is left of their noise, which would be taken for the person.

    A place stays as it is if all of it differs from the empty scene by `LOW` spreads, and some of it by `HIGH`.
    Everything else becomes the empty scene. Where the empty scene is not known, pictures stay as they are.

    Source: Canny 1986 (thresholds with hysteresis)
    """

    name: ClassVar[str] = "hysteresis"

    def run(self, recording: Recording, background: Background) -> Recording:
        """Return the recording as it looks cleared."""
        names = [view.lens.name for view in recording.views]
        scenes = dict(zip(names, zip(background.mean, background.spread, strict=True), strict=True))
        return replace(recording, changes=(*recording.changes, Cleared(scenes)))


@dataclass(frozen=True)
class Cleared:
    """Frames cleared of what is noise beside the empty scenes (mean, spread) of the cameras."""

    scenes: Mapping[str, tuple[F32, F32]]

    def frames(self, source: Recording) -> Iterator[Frame]:
        """Yield the cleared frames."""
        scenes = [self.scenes[view.lens.name] for view in source.views]
        for frame in source.frames():
            pairs = zip(frame.images, scenes, strict=True)
            yield replace(frame, images=tuple(cleared(image, *scene) for image, scene in pairs))


def cleared(image: U8, mean: F32, spread: F32) -> U8:
    """Return an image (H, W, 3) with the empty scene wherever little differs from it."""
    off = np.linalg.norm((image - mean) / spread, axis=2)
    other = linked(off > LOW, off > HIGH) | ~np.isfinite(spread).all(axis=2)
    return np.where(other[..., None], image, np.rint(np.clip(mean, 0, 255))).astype(np.uint8)


def linked(weak: Bool, strong: Bool) -> Bool:
    """Return the connected parts (H, W) of what is `weak` (H, W) that hold something `strong` (H, W)."""
    import cv2

    count, part = cv2.connectedComponents(weak.astype(np.uint8))
    holds = np.zeros(count, bool)
    holds[part[weak & strong]] = True
    return np.asarray(holds[part], bool)
