"""Feet do not go through the floor."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.assets import Body
from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.geometry import kinematics
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_priors.rows import soft_excess, whitened

Positive = Annotated[float, Field(gt=0)]


class GroundPlane(Prior):
    """A soft floor at one height: the lowest point of each part of the feet is pushed up from under it."""

    name: ClassVar[str] = "ground_plane"
    height_m: float = 0.0  # of the floor, world z
    sd_mm: Positive = 10.0  # standard deviation of a point under the floor
    slack_mm: Positive = 5.0  # depth within which the floor is soft
    parts: tuple[str, ...] = ("ankle_l", "toe_l", "ankle_r", "toe_r")  # joints that carry the soles

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row for each part of the feet that the body has, zero above the floor."""
        body, slack, sd = scene.body, self.slack_mm / 1000, self.sd_mm / 1000
        joints, screws = kinematics.chain(body, pose)
        height = kinematics.skin(body, joints, pose.angles)[:, 2]
        carrier = body.skin_joint[np.arange(len(height)), body.skin_weight.argmax(axis=1)]
        errors, rows = [], []
        for name in self.parts:
            sole = np.flatnonzero(carrier == body.joint(name)) if name in body.joint_names else ()
            if len(sole):
                lowest = sole[height[sole].argmin()]
                depth, slope = soft_excess(self.height_m - height[lowest], slack)
                errors.append(depth / sd)
                rows.append(-slope / sd * vertex_velocity(body, joints, screws, int(lowest), pose.angles)[2])
        unknowns = 6 + len(pose.angles)
        return whitened(np.array(errors, np.float64), np.array(rows, np.float64).reshape(-1, unknowns))


def vertex_velocity(body: Body, joints: F64, screws: F64, vertex: int, angles: F64) -> F64:
    """Return how a skinned vertex moves with an increment (omega, v, angles): (3, 6 + D) m.

    Each joint that carries it moves its share of it as if it were fixed to that joint.
    """
    rest = np.append(kinematics.rest_shape(body, angles)[vertex], 1.0)
    below = kinematics.descendants(body.parents)[body.screw_joint]  # (D, J)
    velocity = np.zeros((3, 6 + len(screws)))
    for joint, weight in zip(body.skin_joint[vertex], body.skin_weight[vertex], strict=True):
        place = joints[joint, :3] @ rest
        velocity[:, :3] += weight * np.cross(np.eye(3), place).T
        velocity[:, 3:6] += weight * np.eye(3)
        velocity[:, 6:] += weight * below[:, joint] * (np.cross(screws[:, :3], place) + screws[:, 3:]).T
    return velocity
