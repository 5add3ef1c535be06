"""Segmenter `layered`: the level set's outline, and inside it the contours of parts before others, by their colours."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat

from mocapflow.data import Frame, FrameState, Matches, Past, Segmentation, Surface, Turn
from mocapflow.pooling import pool
from mocapflow.records import F32
from mocapflow.scene import Scene
from mocapflow_levelset.inner import findable_edges, inner_contours
from mocapflow_levelset.layers import COLOURS, colour_model, layer_histograms, layer_of
from mocapflow_levelset.levelset import LevelSet
from mocapflow_levelset.room_colours import ROOM, person_log_ratio, room_histograms

GRID_PX = 4  # colours are taken every so many px, so far from borders
KEPT = 0.9  # share of what is known of the colours that a frame keeps
KEEP_MM = 5.0  # change of the body in a turn below which inner contours stay where outlines do
CALM_MM = 15.0  # change of the body in a turn below which the ends of parts are looked for nearby
FAR_PX, NEAR_PX = 24, 10  # how far along the normal the end of a part is looked for, and once the body is calm


class Layered(LevelSet):
    """The outline as `levelset` finds it; inside it, body parts and garment are told apart by their colours.

    What colours each has is learned from the tracked surface, frame by frame. A part ends where, along the normal of
    its edge in the model, its colours give way to those of other parts. Parts that look alike, as one leg before the
    other, have no contour between them. Matchers `inner_contours` and `layered_icp` use what is found; in the first
    frame nothing is known yet.

    With a `colour_weight` the colours of the room beside the person are learned too, and both join the local statistics
    of the level set. Those are taken where the person is estimated to be; what earlier frames have shown finds a limb
    that was hidden and comes back elsewhere.
    """

    name: ClassVar[str] = "layered"
    colour_weight: NonNegativeFloat = 0.0  # weight of what learned colours say, over that of the local statistics

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the silhouettes, the inner contours, and the colours of layers for the frames to come.

        Colours are learned once, on the second turn: on the first nobody has looked yet where the surface is.
        """
        found = super().segment(frame, state, past, scene, turn)
        if found is state.segmentation and turn.index > 1 and turn.calm(KEEP_MM):
            return found
        surface = scene.surface_of(state)
        colours = dict(state.segmentation.appearance if turn.index > 1 else past.appearance)
        if turn.index == 1:
            colours[COLOURS] = layer_histograms(frame, found.of("person"), surface, scene, past, KEPT, GRID_PX)
            if self.colour_weight:
                colours[ROOM] = room_histograms(frame, found.of("person"), past, KEPT, GRID_PX, self.margin_px)
        return replace(found, inner=self._inner(frame, found, surface, past, scene, turn), appearance=colours)

    def _inner(
        self, frame: Frame, found: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches | None:
        if COLOURS not in past.appearance:
            return None
        layers, known, reach_px = layer_of(scene), colour_model(past), NEAR_PX if turn.calm(CALM_MM) else FAR_PX
        findable = findable_edges(scene, layers, known)
        parts = [
            inner_contours(
                frame.images[s.camera], s, surface, scene.cameras[s.camera], layers, findable, known, reach_px
            )
            for s in found.of("person")
        ]
        return pool(parts) if parts else None

    def _colours(self, past: Past, camera: int) -> F32 | None:
        if not self.colour_weight or ROOM not in past.appearance:
            return None
        return np.float32(self.colour_weight) * person_log_ratio(past, camera)
