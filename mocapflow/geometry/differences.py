"""How draped cloth moves with pose and parameters, by finite differences of one batch of drapes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose, PoseBatch
from mocapflow.geometry import twists
from mocapflow.records import F64, I32, Bool

ANGLE_STEP = np.radians(1.0)  # rad; averages over changes of contact (method: finite differences of the drape)
PARAMETER_STEP = 0.02  # share of the parameter's range

TILTS = (0, 1)  # columns of the root's turns about the level axes

Drape = Callable[[PoseBatch, F64], F64]


def drape_differences(drape: Drape, body: Body, touching: Bool, bounds: F64, pose: Pose, parameters: F64) -> F64:
    """Return velocities (M, 3, 6 + D + Q) of cloth vertices for unit changes of pose and parameters.

    Only tilts of the root and angles that move what the garment can touch are tried.

    Args:
        drape: returns cloth vertices (B, M, 3) m in the world for B poses and parameters (B, Q).
        body: what the garment hangs on.
        touching: joints (J,) that move what the garment hangs from or can touch.
        bounds: of the parameters (Q, 2), each in its unit.
        pose: where the velocities hold.
        parameters: (Q,), likewise.
    """
    tried = tried_columns(body, touching, len(parameters))
    poses, values, steps = neighbours(tried, bounds, pose, parameters, ANGLE_STEP, PARAMETER_STEP)
    draped = drape(poses, values)
    rates = np.moveaxis(draped[:-1] - draped[-1], 0, -1) / steps
    return all_columns(draped[-1], rates, tried, pose, 6 + len(pose.angles) + len(parameters))


def tried_columns(body: Body, touching: Bool, parameters: int) -> I32:
    """Return the columns (S,) of all unknowns that change how the garment lies: tilts, angles, then parameters."""
    from mocapflow.geometry import kinematics  # compiled code, loaded where it is used

    moving = kinematics.descendants(body.parents)[body.screw_joint] @ touching
    first = 6 + len(moving)
    tilted = TILTS if touching.any() else ()
    return np.concatenate([tilted, 6 + np.flatnonzero(moving), np.arange(first, first + parameters)]).astype(np.int32)


def neighbours(
    tried: I32, bounds: F64, pose: Pose, parameters: F64, angle: float, share: float
) -> tuple[PoseBatch, F64, F64]:
    """Return poses and parameters (S + 1, Q) one step along each of S columns and, last, none; and the steps (S,).

    The root tilts about where it stands: about the world's origin it would also be shifted, far.

    Args:
        tried: the columns, of tilts, of angles and of parameters.
        bounds: of the parameters (Q, 2).
        pose: where the steps begin.
        parameters: (Q,), likewise.
        angle: rad, of a step along an angle.
        share: of a parameter's range, of a step along it; never beyond its bounds.
    """
    first = 6 + len(pose.angles)
    lower, upper = bounds.T
    inward = np.where(parameters > 0.5 * (lower + upper), -1.0, 1.0)
    steps = np.concatenate([np.full(first, angle), share * (upper - lower) * inward])[tried]
    moves = np.zeros((len(tried) + 1, first + len(parameters)))
    moves[np.arange(len(tried)), tried] = steps
    root = np.repeat(pose.root[None], len(moves), axis=0)
    for row in np.flatnonzero(np.isin(tried, TILTS)):
        root[row, :3, :3] = twists.exp(moves[row, :6])[:3, :3] @ pose.root[:3, :3]
    poses = PoseBatch(root=root, angles=pose.angles + moves[:, 6:first])
    return poses, parameters + moves[:, first:], np.where(steps == 0, 1.0, steps)


def all_columns(draped: F64, rates: F64, tried: I32, pose: Pose, unknowns: int) -> F64:
    """Return the velocities (M, 3, unknowns) of cloth (M, 3) m with given rates (M, 3, S) along the tried columns.

    Shifts of the root and turns about the vertical carry the garment rigidly. When it tilts, cloth hangs as before
    from what has moved: tilts are tried about the root's place and here brought to the world's origin.
    """
    velocity = np.zeros((len(draped), 3, unknowns))
    velocity[..., :3] = -twists.hat(draped)
    velocity[..., 3:6] = np.eye(3)
    velocity[..., tried] = rates
    for axis in tried[np.isin(tried, TILTS)]:
        velocity[..., axis] += np.cross(np.eye(3)[axis], pose.root[:3, 3])
    return velocity
