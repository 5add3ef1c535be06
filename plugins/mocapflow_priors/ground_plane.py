"""Feet do not go through the floor."""

from __future__ import annotations

from typing import ClassVar

from pydantic import PositiveFloat

from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.scene import Scene
from mocapflow_priors.rows import soft_excess, whitened
from mocapflow_priors.soles import FEET, lowest_points

SLACK = 0.005  # m, depth within which the floor is soft


class GroundPlane(Prior):
    """A soft floor at one height: the lowest point of each part of the feet is pushed up from under it."""

    name: ClassVar[str] = "ground_plane"
    height_m: float = 0.0  # height of the floor, world z
    sd_mm: PositiveFloat = 10.0  # standard deviation of a point under the floor
    parts: tuple[str, ...] = FEET  # joints that carry the soles

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row for each part of the feet that the body has, zero above the floor."""
        height, rate = lowest_points(scene.body, pose, self.parts)
        depth, slope = soft_excess(self.height_m - height, SLACK)
        sd = self.sd_mm / 1000
        return whitened(depth / sd, -(slope / sd)[:, None] * rate)
