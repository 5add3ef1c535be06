"""Normal equations of skinned points on a kinematic chain, summed over joints instead of rows.

A point X = sum_k w_k X_k is carried by its joints k. A unit of the screw s moves X_k by omega x X_k + v if joint k is
below the screw, so a row with gradient g has the derivative s . sum over the joints below of f_k, with the wrench
f_k = w_k (X_k x g, g). The Hessian is therefore s^T (sum of the blocks B_ij over joints i below s and j below t) t,
with B_ij the sum of f_i f_j^T over all rows: nothing per row depends on the number of angles.

Node 0 stands for the root, node j + 1 for joint j; the first six screws are the unit twists of the root. Everything
is about the root's position, so that turning and shifting hardly mix.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry import kinematics
from mocapflow.records import F64
from mocapflow_twist import kernels
from mocapflow_twist.constraint import Rows


class Equations(NamedTuple):
    """A quadratic model of a cost: energy + gradient . z + z . hessian . z / 2."""

    hessian: F64  # (S, S)
    gradient: F64  # (S,)
    energy: float


def body_equations(rows: Rows, body: Body, pose: Pose) -> Equations:
    """Return the normal equations of rows on body vertices for an increment (6 + D,) about the root.

    A shape that changes with an angle is taken as it is at `pose`: its own small part in the motion is left out.

    Source: Rosenhahn 2008, Eq. (12.8)
    """
    joints, screws = kinematics.chain(body, pose)
    rest, centre = kinematics.rest_shape(body, pose.angles), kinematics.root_position(body, pose.root)
    unknowns = 6 + len(screws)
    hessian, gradient = np.empty((unknowns, unknowns)), np.empty(unknowns)
    energy: float = kernels.equations(
        rows.plane, rows.divisor, rows.vertex, rows.weight, rest, body.skin_joint, body.skin_weight,
        joints, body.parents, screws, body.screw_joint, centre, hessian, gradient,
    )  # fmt: skip
    return Equations(hessian, gradient, energy)


def body_energy(rows: Rows, body: Body, pose: Pose) -> float:
    """Return half the weighted squared error of rows on body vertices."""
    joints, _ = kinematics.chain(body, pose)
    rest = kinematics.rest_shape(body, pose.angles)
    energy: float = kernels.energy(
        rows.plane, rows.divisor, rows.vertex, rows.weight, rest, body.skin_joint, body.skin_weight, joints
    )
    return energy


def point_errors(rows: Rows, points: F64) -> tuple[F64, F64]:
    """Return errors (R,) and gradients (R, 3) by the position of points (R, 3) m; zero behind a camera."""
    divisor = np.einsum("ra,ra->r", rows.divisor[:, :3], points) + rows.divisor[:, 3]
    front = divisor >= kernels.BEHIND
    scale = np.where(front, 1.0 / np.where(front, divisor, 1.0), 0.0)
    error = (np.einsum("ra,ra->r", rows.plane[:, :3], points) + rows.plane[:, 3]) * scale
    gradient = (rows.plane[:, :3] - error[:, None] * rows.divisor[:, :3]) * scale[:, None]
    return error, gradient


def dense_equations(rows: Rows, places: F64, velocities: F64) -> Equations:
    """Return the normal equations of rows whose vertices are at places (W, 3) and move with velocities (W, 3, S)."""
    error, gradient = point_errors(rows, places.take(rows.vertex, axis=0))
    jacobian = np.empty((len(error), velocities.shape[2]))
    kernels.jacobian(gradient, velocities, rows.vertex, jacobian)
    weighted = rows.weight[:, None] * jacobian
    return Equations(weighted.T @ jacobian, weighted.T @ error, 0.5 * float(rows.weight @ error**2))
