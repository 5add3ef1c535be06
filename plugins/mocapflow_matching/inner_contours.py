"""Matcher `inner_contours`: the edges of a part before another, as segmenter `layered` has found them."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Surface, Turn, empty_matches
from mocapflow.geometry.cameras import project_each
from mocapflow.scene import Scene
from mocapflow_matching.robust import robust_weights


class InnerContours(Matcher):
    """Draws edges of parts that lie before others (a forearm before the trunk) to where these parts end in the image.

    It needs segmenter `layered`, which finds their ends once a turn; without it there are no pairs.
    """

    name: ClassVar[str] = "inner_contours"
    calm_mm: PositiveFloat = 15.0  # change of the body in a turn below which far pairs are given up (Geman-McClure)
    scale: PositiveFloat = 2.0  # standard deviations at which the loss begins to give way; before it is calm: Huber

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view, weighted by how well they fit the surface."""
        inner = segmentation.inner
        if inner is None:
            return empty_matches()
        image = project_each(surface.vertices[inner.vertex], inner.camera, scene.cameras)
        off = np.abs(np.einsum("ma,ma->m", inner.pixel - image, inner.direction)) * np.sqrt(inner.weight)
        loss = robust_weights(off, "geman_mcclure" if turn.calm(self.calm_mm) else "huber", self.scale)
        return replace(inner, weight=inner.weight * loss)
