"""Matcher `layered_icp`: nearest contours whose colours are those of the part."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from mocapflow_levelset import splits
from mocapflow_levelset.layers import COLOURS, ColourModel, colour_model, layer_of

from mocapflow.data import Frame, Matches, Past, Segmentation, Surface, Turn
from mocapflow.records import I32, Bool
from mocapflow.scene import Scene
from mocapflow_matching.contour_icp import ContourIcp

SURE = 3.0  # log ratio from which on colours are surely another part's
INSIDE = (2, 3)  # px inside of a contour at which its colours are looked up


class LayeredIcp(ContourIcp):
    """As `contour_icp`, but a part of the body makes no pair with a contour whose colours are surely another's.

    A forearm isn't taken to the edge of the skirt beside it. It needs segmenter `layered`, which learns the colours.
    """

    name: ClassVar[str] = "layered_icp"
    residual: Literal["normal"] = "normal"  # the direction of a pair says where its inside is, so it has to have one

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        found = super().match(frame, segmentation, surface, past, scene, turn)
        if COLOURS not in past.appearance:
            return found
        wrong = of_another_layer(found, frame, colour_model(past), layer_of(scene), SURE)
        return replace(found, weight=np.where(wrong, 0.0, found.weight))


def of_another_layer(matches: Matches, frame: Frame, colours: ColourModel, layers: I32, least: float) -> Bool:
    """Return which matches (M,) have, just inside the contour, colours that are surely another layer's."""
    wrong = np.zeros(len(matches.vertex), bool)
    for camera in np.unique(matches.camera):
        rows, image = np.flatnonzero(matches.camera == camera), frame.images[camera]
        own, pixel, direction = layers[matches.vertex[rows]], matches.pixel[rows], matches.direction[rows]
        wrong[rows] = splits.greatest(image, colours.ratio, own, pixel, direction, *INSIDE) < -least
    return wrong
