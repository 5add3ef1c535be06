"""Each match as rows: planes on which the surface point should lie.

A row gives the point X the error (a . X + a0) / (b . X + b0), where (a, a0) is a plane through the target and
(b, b0) a divisor. In the image, the plane runs through the projection centre and the contour's tangent and the
divisor is the depth, which makes it the exact perspective error in pixels. For a projection ray as a Plücker line,
three planes give the components of X x n - m and the divisor is one: an error in metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Matches
from mocapflow.geometry import lines, twists
from mocapflow.geometry.cameras import projections
from mocapflow.records import F64, I32, Bool, array, record
from mocapflow_twist import kernels


@record
class Rows:
    """Scalar errors of surface points; half of weight times squared error is the energy."""

    plane: F64 = array("R", 4, unit="px m or m: error times divisor, as a plane in the world")
    divisor: F64 = array("R", 4, unit="m or 1, as a plane in the world")
    vertex: I32 = array("R", unit="surface vertex index")
    weight: F64 = array("R", unit="one over the variance of the error")
    match: I32 = array("R", unit="index of the match a row comes from")

    def part(self, chosen: Bool, weight: F64, first_vertex: int = 0) -> Rows:
        """Return the chosen rows with new weights and vertices counted from `first_vertex`."""
        rows = np.flatnonzero(chosen)
        return Rows(
            plane=self.plane.take(rows, axis=0),
            divisor=self.divisor.take(rows, axis=0),
            vertex=self.vertex.take(rows) - np.int32(first_vertex),
            weight=weight.take(rows),
            match=self.match.take(rows),
        )


def image_rows(matches: Matches, cameras: Sequence[Camera]) -> Rows:
    """Return distances in the image: along the direction of a match, or along x and y where it has none.

    Args:
        matches: M matches in undistorted pixels.
        cameras: the pinhole cameras.

    Returns:
        One row per match with a direction, two for the others; errors in px.
    """
    views = projections(cameras)
    plane, divisor, match = kernels.image_planes(matches.camera, matches.pixel, matches.direction, views)
    return Rows(
        plane=plane,
        divisor=divisor,
        vertex=matches.vertex.take(match),
        weight=matches.weight.take(match),
        match=match,
    )


def line_rows(matches: Matches, cameras: Sequence[Camera], sigma: float) -> Rows:
    """Return the components of X x n - m for the projection ray (n, m) of every match, in metres at any depth.

    Args:
        matches: M matches in undistorted pixels; their weights count relative to that of a match known to one pixel.
        cameras: the pinhole cameras.
        sigma: standard deviation given to the error of a match known to one pixel, m.

    Returns:
        Three rows per match; errors in m.

    Source: Rosenhahn 2008, Eq. (12.7)
    """
    rays = np.zeros((len(matches.camera), 6))
    for index, camera in enumerate(cameras):
        seen = matches.camera == index
        rays[seen] = lines.through(matches.pixel[seen], camera)
    cross = -twists.hat(rays[:, :3])  # X x n = -n x X
    match = np.repeat(np.arange(len(rays), dtype=np.int32), 3)
    return Rows(
        plane=np.concatenate([cross, -rays[:, 3:, None]], axis=2).reshape(-1, 4),
        divisor=np.tile([0.0, 0.0, 0.0, 1.0], (len(match), 1)),
        vertex=matches.vertex[match],
        weight=matches.weight[match] / sigma**2,
        match=match,
    )
