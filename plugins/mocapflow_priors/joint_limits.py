"""Joints bend no further than they can."""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.scene import Scene
from mocapflow_priors.rows import angle_rows, soft_excess

SLACK = np.radians(2.0)  # excess within which the wall is soft


class JointLimits(Prior):
    """A soft wall at the limits of every joint: nothing inside, a linear error outside."""

    name = "joint_limits"

    sd_deg: PositiveFloat = 2.0  # standard deviation of an angle beyond its limits

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row per joint angle, zero within the limits."""
        low, high = scene.body.limits.T
        sd = np.radians(self.sd_deg)
        above, steeper = soft_excess(pose.angles - high, SLACK)
        below, deeper = soft_excess(low - pose.angles, SLACK)
        return angle_rows((above - below) / sd, (steeper + deeper) / sd, np.arange(len(low)))
