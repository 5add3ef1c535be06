"""Segmenter `layered`: the level set's outline, and inside it the contours of parts before others, by their colours."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from mocapflow.data import Frame, FrameState, Matches, Past, Segmentation, Surface, Turn
from mocapflow.pooling import pool
from mocapflow.records import F32
from mocapflow.scene import Scene
from mocapflow_levelset.inner import Search, inner_contours, told_apart
from mocapflow_levelset.layers import COLOURS, gathered, layer_of, shown
from mocapflow_levelset.levelset import PERSON, LevelSet
from mocapflow_levelset.surround import ROOM, beside, told

GRID_PX = 4  # colours are taken every so many px, so far from borders
KEEP_MM = 5.0  # change of the body in a turn below which inner contours stay where outlines do


class Layered(LevelSet):
    """The outline as `levelset` finds it; inside it, body parts and garment are told apart by their colours.

    What colours each has is learned from the tracked surface, frame by frame. A part ends where, along the normal of
    its edge in the model, its colours give way to those of other parts. Parts that look alike, as one leg before the
    other, have no contour between them. Matchers `inner_contours` and `layered_icp` use what is found; in the first
    frame nothing is known yet.

    With a `colour_weight` the colours of the room beside the person are learned too, and both join the local statistics
    of the level set. Those are taken where the person is believed to be; what earlier frames have shown finds a limb
    that was hidden and comes back elsewhere.
    """

    name: ClassVar[str] = "layered"
    keep: Annotated[float, Field(ge=0, lt=1)] = 0.9  # share of what is known of the colours that a frame keeps
    calm_mm: PositiveFloat = 15.0  # change of the body in a turn below which `later_reach_px` holds
    first_reach_px: PositiveInt = 24  # how far along the normal the end of a part is looked for at first
    later_reach_px: PositiveInt = 10  # how far it is looked for once the body is calm
    least: PositiveFloat = 1.0  # mean log ratio of colours from which on one side is told from the other
    colour_weight: NonNegativeFloat = 0.0  # weight of what learned colours say, over that of the local statistics

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the silhouettes, the inner contours, and the colours of layers for the frames to come.

        Colours are learned once, on the second turn: on the first nobody has looked yet where the surface is.
        """
        found = super().segment(frame, state, past, scene, turn)
        if found is state.segmentation and turn.index > 1 and turn.calm(KEEP_MM):
            return found
        surface = scene.surface(state.estimate.pose, state.cloth)
        colours = dict(state.segmentation.appearance if turn.index > 1 else past.appearance)
        if turn.index == 1:
            colours[COLOURS] = gathered(frame, found.of(PERSON), surface, scene, past, self.keep, GRID_PX)
            if self.colour_weight:
                colours[ROOM] = beside(frame, found.of(PERSON), past, self.keep, GRID_PX, self.margin_px)
        return replace(found, inner=self._inner(frame, found, surface, past, scene, turn), appearance=colours)

    def _inner(
        self, frame: Frame, found: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches | None:
        if COLOURS not in past.appearance:
            return None
        layers, known, search = layer_of(scene), shown(past), self._search(turn)
        findable = told_apart(scene, layers, known)
        parts = [
            inner_contours(frame.images[s.camera], s, surface, scene.cameras[s.camera], layers, findable, known, search)
            for s in found.of(PERSON)
        ]
        return pool(parts) if parts else None

    def _colours(self, past: Past, camera: int) -> F32 | None:
        if not self.colour_weight or ROOM not in past.appearance:
            return None
        return np.float32(self.colour_weight) * told(past, camera)

    def _search(self, turn: Turn) -> Search:
        reach = self.later_reach_px if turn.calm(self.calm_mm) else self.first_reach_px
        return Search(reach, self.least)
