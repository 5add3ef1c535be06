"""The lowest points of the feet, and how they move."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry import kinematics
from mocapflow.memo import memoised
from mocapflow.records import F64

FEET = ("ankle_l", "toe_l", "ankle_r", "toe_r")  # joints that carry the soles


def lowest_points(body: Body, pose: Pose, parts: tuple[str, ...]) -> tuple[F64, F64]:
    """Return the height (K,) m of the lowest point of each part that the body has, and how it moves.

    Args:
        body: at rest.
        pose: of the body.
        parts: joints, each of which stands for the skin that it carries most of.

    Returns:
        heights (K,) m, world z, and their derivatives (K, 6 + D) by an increment (omega, v, angles).
    """
    joints, screws = kinematics.chain(body, pose)
    heights, slopes = [], []
    for part in _parts(body, parts):
        height = kinematics.skin(part, joints, pose.angles)[:, 2]
        lowest = np.array([height.argmin()])
        heights.append(height[lowest[0]])
        slopes.append(kinematics.skin_velocities(part, joints, screws, pose.angles, lowest)[0, 2])
    return np.array(heights, np.float64), np.array(slopes, np.float64).reshape(-1, 6 + len(pose.angles))


@memoised
def _parts(body: Body, names: tuple[str, ...]) -> list[Body]:
    """Return bodies of the skin that each of the joints carries most of."""
    carrier = body.main_joint
    found = [np.flatnonzero(carrier == body.joint(name)) for name in names if name in body.joint_names]
    return [kinematics.part_of(body, vertices) for vertices in found if len(vertices)]
