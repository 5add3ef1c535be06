"""Matcher `containment`: the body stays inside the silhouette, clothed or not."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.assets import Camera
from mocapflow.components import Matcher, pool
from mocapflow.data import Frame, Matches, Past, Segmentation, Silhouette, Surface, Turn, empty_matches
from mocapflow.geometry.contours import at_nearest, nearest_compatible
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_matching.robust import robust_weights
from mocapflow_matching.uncertainty import ANY_DIRECTION

Positive = Annotated[float, Field(gt=0)]


class Containment(Matcher):
    """Pairs points of the bare body's contour that stick out of the image silhouette with the image contour.

    One-sided: a limb inside the silhouette is left alone, so nothing pulls it to the cloth. It reaches further than
    nearest contours may: an arm that has strayed is brought back although no contour looks like it.
    """

    name: ClassVar[str] = "containment"
    spacing_px: Positive = 6.0  # between the points of the contour
    reach_px: Positive = 60.0  # pairs farther apart are left out
    margin_px: float = 0.0  # how far inside the silhouette the skin has to stay
    sigma_px: Positive = 1.0  # standard deviation of a pair
    scale: Positive = 3.0  # standard deviations beyond which a pair pulls no harder (Huber)

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        parts = [(1.0, self.match_view(scene.cameras[s.camera], s, surface)) for s in segmentation.of("person")]
        return pool(parts) if parts else empty_matches()

    def match_view(self, camera: Camera, silhouette: Silhouette, surface: Surface) -> Matches:
        """Return the pairs of one view."""
        model = occluding_contour(surface, camera, self.spacing_px, skin=True)
        outside = np.flatnonzero(inside_px(silhouette, model.pixel) < self.margin_px)
        place, facing = model.pixel.take(outside, axis=0), model.normal.take(outside, axis=0)
        pixel, normal = silhouette.zero_level
        found = nearest_compatible(place, facing, pixel, normal, self.reach_px, ANY_DIRECTION)
        paired = np.flatnonzero(found >= 0)
        direction = normal.take(found[paired], axis=0)
        goal = pixel.take(found[paired], axis=0) - self.margin_px * direction
        off, stray = place.take(paired, axis=0) - goal, outside[paired]
        distance = np.abs(np.einsum("ma,ma->m", off, direction))
        return Matches(
            camera=np.full(len(stray), silhouette.camera, np.int16),
            pixel=model.anchor.take(stray, axis=0) - off,
            direction=direction,
            vertex=model.vertex.take(stray),
            weight=robust_weights(distance / self.sigma_px, "huber", self.scale) / self.sigma_px**2,
        )


def inside_px(silhouette: Silhouette, pixels: F64) -> F64:
    """Return the signed distance (K,) px at the pixels nearest to (K, 2), a smooth field."""
    inside: F64 = at_nearest(silhouette.distance, pixels)
    return inside
