"""Matcher `inner_contours`: the edges of a part before another, where their colours are told apart."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from mocapflow_levelset.layers import CLIP, COLOURS, layer_of, shown
from pydantic import Field

from mocapflow.components import Matcher, pool
from mocapflow.data import BODY, Frame, Matches, Past, Segmentation, Silhouette, Surface, Turn, empty_matches
from mocapflow.scene import Scene
from mocapflow_matching import splits
from mocapflow_matching.inner_edges import behind_edges, chosen, inner_edges
from mocapflow_matching.robust import robust_weights

Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(gt=0)]


class InnerContours(Matcher):
    """Pairs edges of the model inside its silhouette (a forearm before the trunk) with where that part ends.

    It ends where, along the normal of its edge, colours that earlier frames have shown on it give way to those of
    other parts. Parts that look alike, as one leg before the other, make no pair; nor do edges of cloth. It needs
    segmenter `layered`, which learns the colours; the first frame makes no pairs.
    """

    name: ClassVar[str] = "inner_contours"
    spacing_px: Positive = 6.0  # between the points of an edge
    calm_mm: Positive = 15.0  # change of the body in a turn below which reach and loss are the later ones
    first_reach_px: Count = 24  # how far along the normal the end of a part is looked for
    later_reach_px: Count = 10  # the same once it is calm
    half_px: Annotated[int, Field(ge=2)] = 3  # on either side that colours have to agree over
    least: Positive = 1.0  # mean log ratio of colours from which on a side is told from the other
    sigma_px: Positive = 1.0  # standard deviation of a pair, that by the noise of the colours is added
    scale: Positive = 2.0  # standard deviations at which the loss begins to give way

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        if COLOURS not in past.appearance:
            return empty_matches()
        calm = turn.change is not None and turn.change.body <= self.calm_mm / 1000
        parts = [
            (1.0, self.match_view(frame, silhouette, surface, past, scene, calm))
            for silhouette in segmentation.of("person")
        ]
        return pool(parts) if parts else empty_matches()

    def match_view(
        self, frame: Frame, silhouette: Silhouette, surface: Surface, past: Past, scene: Scene, calm: bool
    ) -> Matches:
        """Return the pairs of one view."""
        index, image, camera = silhouette.camera, frame.images[silhouette.camera], scene.cameras[silhouette.camera]
        layers, known = layer_of(scene), shown(past)
        told = (surface.layer == BODY) & known.told[layers]
        edges = inner_edges(surface, camera, self.spacing_px, told)
        reach = self.later_reach_px if calm else self.first_reach_px
        rough = splits.split(
            image, silhouette.distance, known.ratio, layers[edges.vertex], edges.pixel, edges.normal, CLIP, reach,
            self.half_px, self.least,
        )  # fmt: skip
        ended = np.isfinite(rough)  # few, so that what is seen is looked up for few
        edges, rough = chosen(edges, ended), rough[ended]
        behind = behind_edges(surface, camera, edges)
        offset, variance = splits.refine(image, edges.pixel, edges.normal, rough, self.half_px)
        pair = (behind >= 0) & known.apart[layers[edges.vertex], layers[behind]]
        pair &= np.abs(offset - rough) < self.half_px
        edges, offset, sigma = chosen(edges, pair), offset[pair], np.sqrt(self.sigma_px**2 + variance[pair])
        loss = robust_weights(np.abs(offset) / sigma, "geman_mcclure" if calm else "huber", self.scale)
        return Matches(
            camera=np.full(len(offset), index, np.int16),
            pixel=edges.anchor + offset[:, None] * edges.normal,
            direction=edges.normal,
            vertex=edges.vertex,
            weight=loss / sigma**2,
        )
