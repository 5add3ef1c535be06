"""Matcher `containment`: the body stays inside the silhouette, clothed or not."""

from __future__ import annotations

from typing import ClassVar

import numba
import numpy as np
from pydantic import PositiveFloat

from mocapflow.assets import Camera
from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Silhouette, Surface, Turn
from mocapflow.geometry.contours import at_nearest, nearest_compatible
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.pooling import pool
from mocapflow.records import picked_rows
from mocapflow.scene import Scene
from mocapflow_matching.camouflage import without_camouflaged
from mocapflow_matching.robust import robust_precision
from mocapflow_matching.uncertainty import ANY_DIRECTION


class Containment(Matcher):
    """Pairs points of the bare body's contour that stick out of the image silhouette with the image contour.

    One-sided: a limb inside the silhouette is left alone, so nothing pulls it to the cloth. It reaches further than
    nearest contours may: an arm that has strayed is brought back although no contour looks like it.
    """

    name: ClassVar[str] = "containment"
    spacing_px: PositiveFloat = 6.0  # between the points of the contour
    reach_px: PositiveFloat = 60.0  # pairs farther apart are left out
    margin_px: float = 0.0  # how far inside the silhouette the skin has to stay
    sigma_px: PositiveFloat = 1.0  # standard deviation of a pair
    scale: PositiveFloat = 3.0  # standard deviations beyond which a pair pulls no harder (Huber)

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        views = [self.match_view(scene.cameras[s.camera], s, surface) for s in segmentation.of("person")]
        matches, cut = without_camouflaged(pool(views), past), scene.body.cut
        if not cut.any():
            return matches
        return picked_rows(matches, ~np.isin(matches.vertex, np.flatnonzero(cut)))  # there the person goes on

    def match_view(self, camera: Camera, silhouette: Silhouette, surface: Surface) -> Matches:
        """Return the pairs of one view."""
        model = occluding_contour(surface, camera, self.spacing_px, skin=True)
        inside = at_nearest(silhouette.distance, model.pixel)  # px, a smooth field
        outside, target, direction, distance = outside_points(
            inside, model.pixel, model.normal, model.anchor, *silhouette.zero_level, self.margin_px, self.reach_px
        )
        return Matches(
            camera=np.full(len(outside), silhouette.camera, np.int16),
            pixel=target,
            direction=direction,
            vertex=model.vertex.take(outside),
            weight=robust_precision(distance, self.sigma_px, "huber", self.scale),
        )


@numba.njit(cache=True)
def outside_points(inside, place, facing, anchor, pixel, normal, margin, reach):  # type: ignore[no-untyped-def]
    """Return the points of a contour (K,) that are less than `margin` inside, as pairs (M,) with the image contour.

    Returns:
        which points, where their anchors should be (M, 2), across the image contour (M, 2), and how far off (M,).
    """
    outside = np.flatnonzero(inside < margin)
    found = nearest_compatible(place[outside], facing[outside], pixel, normal, reach, ANY_DIRECTION)
    outside, found = outside[found >= 0], found[found >= 0]
    target, direction, distance = np.empty((len(outside), 2)), normal[found], np.empty(len(outside))
    for m in range(len(outside)):
        k, n, (dx, dy) = outside[m], found[m], direction[m]
        x, y = place[k, 0] - (pixel[n, 0] - margin * dx), place[k, 1] - (pixel[n, 1] - margin * dy)
        target[m, 0], target[m, 1] = anchor[k, 0] - x, anchor[k, 1] - y
        distance[m] = abs(x * dx + y * dy)
    return outside, target, direction, distance
