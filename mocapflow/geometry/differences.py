"""How draped cloth moves with pose and parameters, by finite differences of one batch of drapes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose, PoseBatch
from mocapflow.geometry import twists
from mocapflow.records import F64, Bool

ANGLE_STEP = np.radians(1.0)  # rad; averages over changes of contact (method: finite differences of the drape)
PARAMETER_STEP = 0.02  # share of the parameter's range

Drape = Callable[[PoseBatch, F64], F64]


def drape_differences(drape: Drape, body: Body, touching: Bool, bounds: F64, pose: Pose, parameters: F64) -> F64:
    """Return velocities (M, 3, 6 + D + Q) of cloth vertices for unit changes of pose and parameters.

    The root carries the garment rigidly: exact for shifts and for turns about the vertical, and nearly so for the
    small tilts of one step. Only angles that move what the garment can touch are tried.

    Args:
        drape: returns cloth vertices (B, M, 3) m in the world for B poses and parameters (B, Q).
        body: what the garment hangs on.
        touching: joints (J,) that move what the garment hangs from or can touch.
        bounds: of the parameters (Q, 2), each in its unit.
        pose: where the velocities hold.
        parameters: (Q,), likewise.
    """
    from mocapflow.geometry import kinematics  # compiled code, loaded where it is used

    angles, unknowns = len(pose.angles), 6 + len(pose.angles) + len(parameters)
    moving = kinematics.descendants(body.parents)[body.screw_joint] @ touching
    tried = np.concatenate([6 + np.flatnonzero(moving), np.arange(6 + angles, unknowns)])
    lower, upper = bounds.T
    inward = np.where(parameters > 0.5 * (lower + upper), -1.0, 1.0)  # never a step beyond the bounds
    steps = np.concatenate([np.full(6 + angles, ANGLE_STEP), PARAMETER_STEP * (upper - lower) * inward])[tried]
    moves = np.zeros((len(tried) + 1, unknowns))
    moves[np.arange(len(tried)), tried] = steps
    root = np.repeat(pose.root[None], len(moves), axis=0)
    batch = PoseBatch(root=root, angles=pose.angles + moves[:, 6 : 6 + angles])
    draped = drape(batch, parameters + moves[:, 6 + angles :])
    velocity = np.zeros((draped.shape[1], 3, unknowns))
    velocity[..., :3] = -twists.hat(draped[-1])
    velocity[..., 3:6] = np.eye(3)
    velocity[..., tried] = np.moveaxis(draped[:-1] - draped[-1], 0, -1) / np.where(steps == 0, 1.0, steps)
    return velocity
