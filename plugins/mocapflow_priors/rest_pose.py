"""Joints that hardly move stay near rest: the stiff freedoms of knee and elbow, the bend between pelvis and chest."""

from __future__ import annotations

import numpy as np

from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.scene import Scene
from mocapflow_priors.rows import angle_rows


class RestPose(Prior):
    """Holds each angle near zero within the body's `rest_spread`; angles of infinite spread are free."""

    name = "rest_pose"

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row per joint angle of finite spread."""
        stiffness = 1.0 / scene.body.rest_spread
        return angle_rows(pose.angles * stiffness, stiffness, np.flatnonzero(stiffness > 0))
