"""People do not jerk: the pose stays near the continuation of the last two frames."""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.geometry import twists
from mocapflow.geometry.kinematics import root_position
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_priors.extrapolate import continued, interval
from mocapflow_priors.rows import whitened

RATE = 30.0  # Hz that the standard deviations are stated for


class SmoothMotion(Prior):
    """Holds the pose near constant velocity, within what people accelerate in one frame.

    The deviations are stated at 30 Hz and go with the square of the frame interval, as the effect of an
    acceleration does. A prior does not know the time of the frame it judges: it takes the last interval for the
    coming one. It says nothing before there are two frames.
    """

    name = "smooth_motion"

    angle_sd_deg: PositiveFloat = 5.0  # standard deviation of every joint angle
    root_sd_deg: PositiveFloat = 3.0  # standard deviation of the root's orientation
    root_sd_mm: PositiveFloat = 10.0  # standard deviation of the root's place

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return three rows for the root's turn, three for its place and one per joint angle."""
        step = interval(past)
        unknowns = 6 + len(pose.angles)
        if step == 0:
            return whitened(np.empty(0), np.empty((0, unknowns)))
        expected = continued(past, 1.0)
        turn = twists.log_rotation(pose.root[:3, :3] @ expected.root[:3, :3].T)
        place, goal = (root_position(scene.body, root) for root in (pose.root, expected.root))
        jacobian = np.eye(unknowns)
        jacobian[:3, :3] = turn_rate(turn)
        jacobian[3:6, :3] = -twists.hat(place)
        deviation = [turn, place - goal, pose.angles - expected.angles]
        sharpness = self._sharpness(len(pose.angles), step)
        return whitened(sharpness * np.concatenate(deviation), sharpness[:, None] * jacobian)

    def _sharpness(self, angles: int, step: float) -> F64:
        sd = [
            np.full(3, np.radians(self.root_sd_deg)),
            np.full(3, self.root_sd_mm / 1000),
            np.full(angles, np.radians(self.angle_sd_deg)),
        ]
        return 1.0 / (np.concatenate(sd) * (step * RATE) ** 2)


def turn_rate(turn: F64) -> F64:
    """Return the derivative (3, 3) of a rotation vector (3,) by a small turn in the world before it."""
    angle = float(np.linalg.norm(turn))
    w = twists.hat(turn)
    if angle < twists.SMALL_ANGLE:
        bend = 1 / 12 + angle**2 / 720
    else:
        bend = 1 / angle**2 - np.sin(angle) / (2 * angle * (1 - np.cos(angle)))
    return np.eye(3) - 0.5 * w + bend * (w @ w)
