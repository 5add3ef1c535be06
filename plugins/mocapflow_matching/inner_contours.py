"""Matcher `inner_contours`: the edges of a part before another, as segmenter `layered` has found them."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Surface, Turn, empty_matches
from mocapflow.geometry.cameras import magnification, project_each
from mocapflow.records import F64, I32
from mocapflow.scene import Scene
from mocapflow_matching.camouflage import without_camouflaged
from mocapflow_matching.robust import robust_weights

FEWEST = 8  # pairs of a waistband: fewer do not tell a tilt from a height


class InnerContours(Matcher):
    """Draws edges of parts that lie before others (a forearm before the trunk) to where these parts end in the image.

    The edge at which the skin holds a garment, a waistband, is such an edge too: it says how the trunk is tilted. If it
    sits higher or lower all around than the tape measure says, that is no tilt: its pairs are moved back by as much, to
    the surface, and so hold the height of the guess a little. It needs segmenter `layered`, which finds the ends of
    parts once a turn; without it there are no pairs.

    Skin that the garment covers at rest is believed only where its edge is near: where the drape bares a thigh, the
    true cloth may lie over it, and what looks like its edge is a fold. `covered: far` believes it as other skin, where
    frames are so far apart that only far edges find a leg.
    """

    name: ClassVar[str] = "inner_contours"
    calm_mm: PositiveFloat = 15.0  # change of the body in a turn below which far pairs are given up (Geman-McClure)
    covered: Literal["near", "far"] = "near"  # far pairs of skin that the garment covers at rest are given up, or not
    scale: PositiveFloat = 2.0  # standard deviations at which the loss begins to give way; before it is calm: Huber

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view, weighted by how well they fit the surface."""
        if segmentation.inner is None:
            return empty_matches()
        inner = without_camouflaged(segmentation.inner, past)
        image = project_each(surface.vertices[inner.vertex], inner.camera, scene.cameras)
        away = np.einsum("ma,ma->m", inner.pixel - image, inner.direction)
        garment = scene.garment_index[inner.vertex]
        higher = slipped(away, garment, inner, surface, scene)
        off = np.abs(away - higher) * np.sqrt(inner.weight)
        late, early = (robust_weights(off, loss, self.scale) for loss in ("geman_mcclure", "huber"))
        doubtful = scene.covered.take(inner.vertex) & (self.covered == "near")
        loss = np.where(turn.calm(self.calm_mm) | doubtful, late, early)
        tell = (garment < 0) | (np.bincount(garment + 1)[garment + 1] >= FEWEST)  # so many of one garment
        return replace(inner, pixel=inner.pixel - higher[:, None] * inner.direction, weight=inner.weight * loss * tell)


def slipped(away: F64, garment: I32, inner: Matches, surface: Surface, scene: Scene) -> F64:
    """Return by how many px (M,) a waistband is away all around: the median length; pairs of the body are by none.

    Args:
        away: (M,) px of each pair, along its direction.
        garment: (M,) of each pair, see `Scene.garment_index`.
        inner: the pairs.
        surface: where they are estimated to be.
        scene: the cameras.
    """
    by = np.zeros(len(away))
    for worn in (garment == k for k in range(len(scene.pieces)) if (garment == k).any()):
        place = surface.vertices[inner.vertex[worn]].mean(axis=0)
        size = np.array([magnification(camera, place) for camera in scene.cameras])[inner.camera[worn]]
        by[worn] = size * np.median(away[worn] / size)
    return by
