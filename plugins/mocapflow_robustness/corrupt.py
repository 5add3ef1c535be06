"""Stage `corrupt`: disturbs a recording on purpose, the same way every time, as its frames are read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal
from zlib import crc32

import numpy as np
from pydantic import Field, NonNegativeInt, model_validator

from mocapflow.components import Stage
from mocapflow.data import Frame
from mocapflow.errors import RecordingError, alternatives
from mocapflow.geometry.camera_rotation import warped
from mocapflow.recordings.recording import Recording
from mocapflow.records import U8
from mocapflow_robustness import disturbances
from mocapflow_robustness.events import Event
from mocapflow_robustness.occlusion import occlusion_masks, union
from mocapflow_robustness.sequential_reader import SequentialReader

Share = Annotated[float, Field(ge=0, le=1)]
Readers = dict[tuple[Event, str], SequentialReader]


class Corrupt(Stage):
    """Noise, rectangles and a stripe over every picture, and events: wrong or missing pictures, a knocked camera.

    Pictures are changed as they are read; the files are left alone. What becomes of a picture depends on the seed, its
    camera and its number only. Clean plates stay clean.
    """

    name: ClassVar[str] = "corrupt"
    seed: NonNegativeInt = 0  # of the noise and of where rectangles lie
    noise: Share = 0.0  # share of the pixels that get a random colour
    noise_kind: Literal["replaced", "added"] = "replaced"  # added: noise up to that share of the range, on every pixel
    noise_over: bool = False  # noise lies over rectangles and stripe, as of a bad sensor, or else under them
    rectangles: tuple[NonNegativeInt, NonNegativeInt] = (0, 0)  # grey ones on each picture, at least and at most
    stripe: Share = 0.0  # height of a black stripe, share of the picture
    stripe_centre: Share = 0.5  # middle of the stripe from the top, share of the picture
    events: tuple[Event, ...] = ()  # where two meet, the later one in this list counts

    @model_validator(mode="after")
    def _at_least_is_not_more_than_at_most(self) -> Corrupt:
        if self.rectangles[0] > self.rectangles[1]:
            raise ValueError("rectangles: [at least, at most]")
        return self

    def need(self, recording: Recording) -> None:
        """Raise if an event names a camera that is not there, or wants another one where there is one."""
        names = [view.lens.name for view in recording.views]
        for view in (view for event in self.events for view in event.views):
            if view not in names:
                raise RecordingError(f"corrupt: there is no camera '{view}'", hint=alternatives(view, names))
        if len(names) < 2 and any(event.what == "other_camera" for event in self.events):
            raise RecordingError("corrupt: there is no other camera to show", hint="choose `what: other_time`")

    def run(self, recording: Recording) -> Recording:
        """Return the recording as it looks when disturbed.

        Raises:
            RecordingError: a camera is missing, see `need`.
        """
        self.need(recording)
        return replace(recording, changes=(*recording.changes, Corruption(self, recording)))


@dataclass(frozen=True)
class Corruption:
    """Frames disturbed by the settings of a stage; `whole` is the recording with all its cameras."""

    settings: Corrupt
    whole: Recording

    def frames(self, source: Recording) -> Iterator[Frame]:
        """Yield the disturbed frames."""
        names = [view.lens.name for view in source.views]
        readers: Readers = {}
        for frame in source.frames():
            yield self._disturbed(frame, names, readers)

    def _disturbed(self, frame: Frame, names: list[str], readers: Readers) -> Frame:
        images, usable = list(frame.images), frame.usable.copy()
        reasons = list(frame.reasons or [""] * len(names))
        keypoints = None if frame.keypoints is None else list(frame.keypoints)
        events = [self._event(frame.index, view) for view in names]
        for camera, (view, event) in enumerate(zip(names, events, strict=True)):
            if event is not None and event.what == "dropped":
                usable[camera], reasons[camera] = False, "dropped"
                images[camera] = np.zeros_like(images[camera])
            elif usable[camera]:
                rng = np.random.default_rng([self.settings.seed, crc32(view.encode()), frame.index])
                image = images[camera]
                image = image if event is None else self._instead(event, image, frame, view, rng, readers)
                images[camera] = self._spoiled(image, rng)
            if event is not None and keypoints is not None:
                keypoints[camera] = keypoints[camera][:0]
        return replace(
            frame,
            images=tuple(images),
            usable=usable,
            reasons=() if usable.all() else tuple(reasons),
            hidden=union(frame.hidden, occlusion_masks(events, images)),
            keypoints=None if keypoints is None else tuple(keypoints),
        )

    def _event(self, index: int, view: str) -> Event | None:
        """Return what happens to a frame of a view."""
        return next((event for event in reversed(self.settings.events) if event.holds(index, view)), None)

    def _spoiled(self, image: U8, rng: np.random.Generator) -> U8:
        """Return a picture with what spoils every picture."""
        steps = (self._covered, self._noisy) if self.settings.noise_over else (self._noisy, self._covered)
        for spoil in steps:
            image = spoil(image, rng)
        return image

    def _noisy(self, image: U8, rng: np.random.Generator) -> U8:
        chosen = self.settings
        return disturbances.noisy(image, chosen.noise, chosen.noise_kind, rng) if chosen.noise else image

    def _covered(self, image: U8, rng: np.random.Generator) -> U8:
        chosen = self.settings
        if chosen.rectangles[1]:
            image = disturbances.with_rectangles(image, chosen.rectangles, rng)
        return disturbances.with_stripe(image, chosen.stripe, chosen.stripe_centre) if chosen.stripe else image

    def _instead(
        self, event: Event, image: U8, frame: Frame, view: str, rng: np.random.Generator, readers: Readers
    ) -> U8:
        """Return what an event puts in the place of a picture."""
        if event.what == "black":
            return np.zeros_like(image)
        if event.what == "torn":
            return disturbances.torn(image, rng)
        if event.what == "covered":
            return disturbances.covered(image, event.first_covered(len(image)), len(image))
        names = [v.lens.name for v in self.whole.views]
        if event.what == "knocked":
            return warped(image, event.homography(self.whole.cameras[names.index(view)]))[0]
        camera = (names.index(view) + (event.what == "other_camera")) % len(names)
        reader = readers.setdefault((event, view), SequentialReader(self.whole.seen_by(camera)))
        return fitted(reader.at(event.source(frame.index, self.whole.length)).images[0], image)


def fitted(image: U8, like: U8) -> U8:
    """Return an image (H, W, 3) in the size of another."""
    import cv2

    size = like.shape[1::-1]
    return image if image.shape == like.shape else np.asarray(cv2.resize(image, size), np.uint8)
