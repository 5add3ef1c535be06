"""Stage `background`: the empty scene, from clean plates or from the recording itself."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from mocapflow_fitting.detections import has_keypoints
from mocapflow_levelset.floor_height import floor_height, grey_floor
from pydantic import Field

from mocapflow.assets import Background
from mocapflow.components import Stage
from mocapflow.data import NO_CLOTH, Start
from mocapflow.errors import RecordingError
from mocapflow.io.recording.plates import plate_files
from mocapflow.recordings.recording import Recording
from mocapflow.records import U8, Bool
from mocapflow.scene import Scene
from mocapflow_sequence.dominant_colours import dominant_colours
from mocapflow_sequence.first_frame import empty_scene
from mocapflow_sequence.learnt import LEAST_SHARE, Learnt, spread_out
from mocapflow_sequence.people import people_seen

LOG = logging.getLogger("mocapflow")
TURNED = (
    "%s has moved by %.1f px since its clean plate was taken, which is laid over its first picture;"
    " if its calibration is older than that, too, calibrate again, or see the stage align_cameras"
)
NO_PLATES = (
    "no clean plates in %s: the recording itself tells what is behind the person, but not where they always stand%s"
)
MORE = "; 2D keypoints in keypoints/ would tell more (examples/mediapipe_keypoints.py)"
FLOOR_FRAMES = 4  # in which the person's shadow may tell the height of the floor


class EmptyScene(Stage):
    """Learns what the cameras see without the person.

    Without clean plates it takes one of the dominant colours of each pixel over the whole recording. If a stage before
    makes a `Start`, the pose of the first frame and the colours beside the person in it tell which is the room's; else
    it is the most common one. Nobody knows what is behind a person who stays in place throughout. Where the recording
    has 2D keypoints, what is near those of a picture is not the room in it, whatever its colour: so white socks are not
    taken for a pale floor. Memory is bounded by `samples` pictures of one camera.

    Of a floor without colours it learns the height, too, if the person's shadow tells it: then views can tell grey
    clothes from shadows together (`mocapflow_levelset.shadow_consistency`).
    """

    name: ClassVar[str] = "background"
    extent: ClassVar[Literal["first"]] = "first"  # that of the `Start`; pictures come from all over the recording
    source: Literal["auto", "plates", "recording"] = "auto"  # auto: the plates where there are any
    samples: Annotated[int, Field(ge=3)] = 50  # pictures of each camera that are looked at

    def has_plates(self, recording: Recording) -> bool:
        """Return whether clean plates show the empty scene, so that it need not be learnt."""
        return self.source != "recording" and bool(plate_files(recording.folder, recording.views))

    def need(self, recording: Recording) -> None:
        """Raise if plates are wanted and missing, or if a camera lacks one though others have theirs."""
        if self.source == "recording":
            return
        if not plate_files(recording.folder, recording.views) and self.source == "plates":
            raise RecordingError(
                "there are no clean plates",
                where=str(recording.folder / "background"),
                hint="put one picture per camera there (cam01.png …), or set source: recording",
            )

    def run(self, recording: Recording, scene: Scene, start: Start | None = None) -> Background:
        """Return mean and spread of every pixel of the empty scene.

        Raises:
            RecordingError: plates are missing, see `need`, or a camera has too few readable frames to learn from.
        """
        self.need(recording)
        room = self._room(recording, scene, start)
        return room if start is None else replace(room, floor_m=self._floor(room, recording, scene, start))

    def _room(self, recording: Recording, scene: Scene, start: Start | None) -> Background:
        plates = None if self.source == "recording" else recording.background()
        if plates is not None:
            for view, shift in zip(recording.views, plates.turned_px, strict=True):
                if shift:
                    LOG.warning(TURNED, view.lens.name, shift)
            return plates
        if self.source == "auto":
            LOG.warning(NO_PLATES, recording.folder / "background", "" if has_keypoints(recording) else MORE)
        learnt = list(self._learnt(recording, scene, start))
        return Background(mean=tuple(view.mean for view in learnt), spread=tuple(view.spread for view in learnt))

    def _floor(self, room: Background, recording: Recording, scene: Scene, start: Start) -> float | None:
        """Return the height of a floor without colours, looked for about the lowest point of the start pose."""
        body = scene.undressed.surface(start.pose, NO_CLOTH)
        if not grey_floor(room, scene.cameras, body):
            return None
        step = max(recording.length // FLOOR_FRAMES, 1)
        frames = (recording.frame(index) for index in range(step // 2, recording.length, step))
        return floor_height(frames, room, scene.cameras, float(body.vertices[:, 2].min()))

    def _learnt(self, recording: Recording, scene: Scene, start: Start | None) -> Iterator[Learnt]:
        """Yield the empty scene of each view; without a start pose the dominant colours, whoever's they are."""
        pictures = (self._pictures(recording, c) for c in range(len(recording.views)))
        if start is None:
            yield from (self._dominant_colours(*seen) for seen in pictures)
            return
        first, body = recording.frame(recording.indices[0]), scene.undressed.surface(start.pose, NO_CLOTH)
        for c, seen in enumerate(pictures):
            if first.usable[c]:
                alone = people_seen(recording, c, [first.index]).beside(first.index, first.images[c].shape)
                images, nobody = seen
                yield empty_scene(images, first.images[c], body, scene.cameras[c], nobody, alone)
            else:
                yield self._dominant_colours(*seen)

    def _dominant_colours(self, pictures: U8, nobody: Bool) -> Learnt:
        mean, spread, share = dominant_colours(pictures, 1, nobody)[0]
        return Learnt(mean, np.where(share[..., None] >= LEAST_SHARE, spread, np.float32(np.inf)))

    def _pictures(self, recording: Recording, camera: int) -> tuple[U8, Bool]:
        """Return pictures (N, H, W, 3) of one camera, spread over the recording, and where (N, H, W) nobody is seen."""
        frames = list(spread_out(recording, camera, range(recording.length), self.samples))
        if len(frames) < 3:
            raise RecordingError(
                f"{recording.views[camera].lens.name} has {len(frames)} readable frames: too few to tell the room",
                where=str(recording.folder),
                hint="give a clean plate in background/, or a longer recording",
            )
        people = people_seen(recording, camera, [frame.index for frame in frames])
        nobody = [people.beside(frame.index, frame.images[0].shape) for frame in frames]
        return np.stack([frame.images[0] for frame in frames]), np.stack(nobody)
