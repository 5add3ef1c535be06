"""A foot that is hardly off the floor stands on it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_priors.rows import whitened
from mocapflow_priors.soles import FEET, lowest_points


class FootContact(Prior):
    """The lowest point of each part of the feet is on the floor if it is near it; farther off it is let go.

    A nearly straight leg tells its bend by its length: a foot 3 mm too high is 2.5 degrees of knee, and 3 mm are what a
    contour in the foot's own shadow is wrong by. Where the floor is not at `height_m` this says nothing. In the first
    frame, whose pose may be centimetres off, it is silent. It is for people who stand: a foot that rises slowly is held
    back for some frames.
    """

    name: ClassVar[str] = "foot_contact"
    height_m: float = 0.0  # of the floor, world z
    sd_mm: PositiveFloat = 1.0  # standard deviation of the height of a foot that stands
    reach_mm: PositiveFloat = 4.0  # height at which the pull gives way (Geman-McClure)
    parts: tuple[str, ...] = FEET  # joints that carry the soles

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row for each part of the feet that the body has."""
        if not past.moments:
            return whitened(np.empty(0), np.empty((0, 6 + len(pose.angles))))
        height, rate = lowest_points(scene.body, pose, self.parts)
        error, slope = geman_mcclure((height - self.height_m) * 1000, self.reach_mm)
        return whitened(error / self.sd_mm, (1000 * slope / self.sd_mm)[:, None] * rate)


def geman_mcclure(error: F64, scale: float) -> tuple[F64, F64]:
    """Return a redescending residual of errors (K,), whose square is e^2 s^2 / (e^2 + s^2), and its derivative."""
    length = np.sqrt(error**2 + scale**2)
    return error * scale / length, (scale / length) ** 3
