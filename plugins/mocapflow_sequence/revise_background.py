"""Stage `revise_background`: the empty scene learnt from the recording, once more, by where a track has the person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from mocapflow.assets import Background, Camera
from mocapflow.components import Stage
from mocapflow.data import Surface
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.silhouettes import covered, distance_to
from mocapflow.recordings.recording import Recording
from mocapflow.records import U8, Bool
from mocapflow.results import Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow_sequence.background import EmptyScene
from mocapflow_sequence.colours import DEEP, Colours, alike, every, shaded
from mocapflow_sequence.dominant_colours import dominant_colours
from mocapflow_sequence.learnt import LEAST_SHARE, Learnt, brightest, shown, spread_out

LEAST = 3  # pictures that have to show a colour


class ReviseBackground(Stage):
    """Learns the empty scene once more, by where a track has the person; clean plates stay as they are.

    What a picture shows away from the person is the room, or their shadow: of each pixel the colour that is the most
    common in such pictures is taken, as bright as any of them shows it. It replaces what the stage `background` took
    for the room, unless that is the same colour, or the same in more light. A part of the person that was taken for the
    room because the start pose had it elsewhere is gone then, and much of what was unknown is known.

    What no tracked picture shows beside the person stays as it was, and frames that are lost or doubted tell nothing; a
    view whose camera was knocked stays as it was, too.
    """

    name: ClassVar[str] = "revise_background"
    extent: ClassVar[Literal["run"]] = "run"
    samples: Annotated[int, Field(ge=3)] = 50  # pictures of each camera that are looked at
    away_m: PositiveFloat = 0.03  # from the model: farther off, a picture shows the room

    def run(
        self,
        recording: Recording,
        scene: Scene,
        track: Track,
        background: Background,
        first: EmptyScene,
        checks: ViewChecks | None = None,
    ) -> Background:
        """Return the empty scene by what the frames of the track show beside the person."""
        if first.has_plates(recording):
            return background
        knocked = () if checks is None or checks.knocks is None else checks.knocks.camera.tolist()
        views = [Learnt(*pair) for pair in zip(background.mean, background.spread, strict=True)]
        for camera, before in enumerate(views):
            seen = [] if camera in knocked else list(self._seen(recording, scene, track, camera))
            if len(seen) >= LEAST:
                pictures, away = (np.stack(part) for part in zip(*seen, strict=True))
                views[camera] = revised(before, pictures, away)
        mean, spread = zip(*views, strict=True)
        return replace(background, mean=mean, spread=spread)

    def _seen(self, recording: Recording, scene: Scene, track: Track, camera: int) -> Iterator[tuple[U8, Bool]]:
        """Yield pictures (H, W, 3) of a view that were tracked, each with where (H, W) it shows the room."""
        telling = ~track.lost & ~track.doubted & track.usable[:, camera]
        rows = {int(track.frame[row]): row for row in np.flatnonzero(telling).tolist()}
        for frame in spread_out(recording, camera, recording.indices, self.samples):
            if frame.index in rows:
                row, hidden = rows[frame.index], frame.hidden_in(0)
                surface = scene.surface(track.pose(row), track.cloth_at(row))
                away = self._away(surface, scene.cameras[camera])
                yield frame.images[0], away if hidden is None else away & ~hidden

    def _away(self, surface: Surface, camera: Camera) -> Bool:
        """Return which pixels (H, W) of a view are away from a surface."""
        inside = covered(surface, camera)
        if not inside.any():
            return ~inside
        away_px = self.away_m * magnification(camera, surface.vertices.mean(axis=0))
        return np.asarray(distance_to(inside) > away_px)


def revised(before: Learnt, pictures: U8, away: Bool) -> Learnt:
    """Return one view of the empty scene by pictures (N, H, W, 3) that show it where (N, H, W) they are away.

    Args:
        before: what is known of it.
        pictures: BGR, from all over a track.
        away: True away from the person.
    """
    (usual,) = dominant_colours(pictures, 1, away)
    noise = np.median(usual.spread, axis=(0, 1))
    enough = usual.share >= max(LEAST_SHARE, LEAST / len(pictures))
    lit = ((shown(picture, noise), there) for picture, there in zip(pictures, away, strict=True))
    found = Colours(*brightest(Learnt(usual.mean, usual.spread), lit), usual.share)
    kept = Learnt(before.mean.copy(), before.spread.copy())
    kept.take(found, enough & ~_confirmed(before, found))
    return kept


def _confirmed(before: Learnt, found: Colours) -> Bool:
    """Return where (H, W) what was known is what was found, or the same in more light."""
    lighter = every(before.mean > found.mean) & shaded(before.mean, found.mean, DEEP)
    return np.asarray(before.known & (alike(found, before.mean) | lighter))
