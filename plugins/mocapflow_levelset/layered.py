"""Segmenter `layered`: the level set's outline, and the colours of the layers inside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from pydantic import Field

from mocapflow.data import Frame, FrameState, Past, Segmentation, Turn
from mocapflow.scene import Scene
from mocapflow_levelset.layers import COLOURS, gathered
from mocapflow_levelset.levelset import PERSON, LevelSet


class Layered(LevelSet):
    """The outline as `levelset` finds it; inside it, body parts and garment are told apart by their colours.

    What colours each has is learned from the tracked surface, frame by frame; matcher `inner_contours` finds by them
    where one part ends before another.
    """

    name: ClassVar[str] = "layered"
    keep: Annotated[float, Field(ge=0, lt=1)] = 0.9  # of what is known of the colours, from frame to frame
    grid_px: Annotated[int, Field(ge=1)] = 4  # colours are taken every so many px, so far from borders

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the silhouettes, and the colours of layers for the frames to come.

        On the first turn nobody has looked yet where the surface is, so nothing is learned.
        """
        found = super().segment(frame, state, past, scene, turn)
        if turn.index == 0:
            return replace(found, appearance=past.appearance)
        if found is state.segmentation and turn.index > 1:
            return found
        surface = scene.surface(state.estimate.pose, state.cloth)
        layers = gathered(frame, found.of(PERSON), surface, scene, past, self.keep, self.grid_px)
        return replace(found, appearance={**found.appearance, COLOURS: layers})
