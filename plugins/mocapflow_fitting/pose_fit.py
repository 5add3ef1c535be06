"""Poses of many frames and proportions they share: damped Gauss-Newton with limits and stiffness as priors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry import kinematics
from mocapflow.model import moved
from mocapflow.records import F64, I32
from mocapflow_fitting.proportions import SHAPE, scaled

FREE_SPREAD = np.radians(60.0)  # rad, of angles the body leaves free: unseen joints stay near rest
LIMIT_SPREAD = np.radians(2.0)  # rad, by how much an angle may pass a limit
CAUCHY = 2.0  # standard deviations at which the weight of an observation has halved
ENOUGH = 1e-6  # share of the cost below which a gain is none
NEAREST = 0.1  # m, depth below which a projection is not believed
STEP = 1e-4  # of a log proportion, for differences

# What is fitted, with its standard deviation about zero: logarithms of proportions, deviations along modes of a shape.
Spreads = Mapping[str, float]


class Observed(NamedTuple):
    """Residuals (N, m) of points, their derivatives (N, m, 3), the points they belong to and 1/sd (N,)."""

    error: F64
    slope: F64
    point: I32
    precision: F64


class View(NamedTuple):
    """What was observed of one moment: a body whose vertices are the points, and how they are compared."""

    body: Body
    look: Callable[[F64], Observed]


class Solution(NamedTuple):
    """Shared log proportions and deviations of the shape (P,), named as their spreads, and the pose of each moment."""

    spreads: Spreads
    logs: F64
    poses: tuple[Pose, ...]

    @property
    def factors(self) -> Mapping[str, float]:
        """The proportions, and the deviations of the shape, by name."""
        values = zip(self.spreads, self.logs.tolist(), strict=True)
        return {name: value if name.startswith(SHAPE) else math.exp(value) for name, value in values}


def projected(points: F64, matrices: F64) -> tuple[F64, F64, F64]:
    """Return pixels (N, 2) of points (N, 3), their derivatives (N, 2, 3) by the points, and depths (N,) m.

    Each point has its own projection matrix (N, 3, 4). Behind a camera, where a bad guess may put it, it counts as
    close before it.
    """
    homogeneous = np.einsum("nab,nb->na", matrices[:, :, :3], points) + matrices[:, :, 3]
    depth = np.maximum(homogeneous[:, 2], NEAREST)
    pixel = homogeneous[:, :2] / depth[:, None]
    slope = (matrices[:, :2, :3] - pixel[..., None] * matrices[:, 2:, :3]) / depth[:, None, None]
    return pixel, slope, depth


def descend(views: Sequence[View], solution: Solution, rounds: int = 80) -> Solution:
    """Levenberg-Marquardt over all moments at once; the poses are eliminated one by one (Schur complement)."""
    damping, cost = 1e-3, _cost(views, solution)
    for _ in range(rounds):
        blocks = [_normal(view, pose, solution) for view, pose in zip(views, solution.poses, strict=True)]
        while damping < 1e8:
            trial = _step(blocks, solution, damping)
            lower = _cost(views, trial)
            if lower <= cost:
                break
            damping *= 8
        else:
            return solution
        gain, cost, solution, damping = cost - lower, lower, trial, max(damping / 5, 1e-9)
        if gain < ENOUGH * cost:
            return solution
    return solution


def _step(blocks: Sequence[tuple[F64, F64]], solution: Solution, damping: float) -> Solution:
    shared = len(solution.logs)
    precision = np.array([1 / sd**2 for sd in solution.spreads.values()])
    left, right = np.diag(precision * (1 + damping)), -precision * solution.logs
    solved = []
    for matrix, vector in blocks:
        pose = matrix[shared:, shared:] + damping * np.diag(np.diag(matrix[shared:, shared:]))
        both = np.linalg.solve(pose, np.column_stack([matrix[shared:, :shared], -vector[shared:]]))
        left = left + matrix[:shared, :shared] - matrix[:shared, shared:] @ both[:, :shared]
        right = right - vector[:shared] - matrix[:shared, shared:] @ both[:, -1]
        solved.append(both)
    logs = np.linalg.solve(left, right) if shared else np.empty(0)
    steps = [np.asarray(both[:, -1] - both[:, :shared] @ logs, np.float64) for both in solved]
    poses = tuple(moved(pose, step) for pose, step in zip(solution.poses, steps, strict=True))
    return solution._replace(logs=solution.logs + logs, poses=poses)


def _normal(view: View, pose: Pose, solution: Solution) -> tuple[F64, F64]:
    """Return the normal matrix and gradient of one moment over (log proportions, root, angles)."""
    points, moves = velocities(view.body, pose, solution)
    observed = view.look(points)
    jacobian = np.einsum("nmi,nis->nms", observed.slope, moves[observed.point])
    weight = observed.precision**2 / (1 + _squared(observed) / CAUCHY**2)
    rows = (np.sqrt(weight)[:, None, None] * jacobian).reshape(-1, moves.shape[2])
    errors = (np.sqrt(weight)[:, None] * observed.error).ravel()
    matrix, vector = rows.T @ rows, rows.T @ errors
    angles = slice(len(solution.logs) + 6, None)
    error, precision = _prior(view.body, pose.angles)
    matrix[angles, angles] += np.diag((precision**2).sum(axis=0))
    vector[angles] += (precision**2 * error).sum(axis=0)
    return matrix + 1e-6 * np.eye(len(vector)), vector


def _cost(views: Sequence[View], solution: Solution) -> float:
    cost = 0.5 * sum((log / sd) ** 2 for log, sd in zip(solution.logs, solution.spreads.values(), strict=True))
    for view, pose in zip(views, solution.poses, strict=True):
        body = scaled(view.body, solution.factors)
        observed = view.look(kinematics.skin(body, kinematics.chain(body, pose)[0], pose.angles))
        error, precision = _prior(body, pose.angles)
        cost += 0.5 * CAUCHY**2 * np.log1p(_squared(observed) / CAUCHY**2).sum()
        cost += 0.5 * ((precision * error) ** 2).sum()
    return float(cost)


def _squared(observed: Observed) -> F64:
    return np.asarray((observed.error**2).sum(axis=1) * observed.precision**2)


def _prior(body: Body, angles: F64) -> tuple[F64, F64]:
    """Return errors (2, D) and 1/sd (2, D): distance from rest, and beyond the limits."""
    beyond = angles - np.clip(angles, *body.limits.T)
    spread = np.where(np.isfinite(body.rest_spread), body.rest_spread, FREE_SPREAD)
    return np.stack([angles, beyond]), np.stack([1 / spread, np.where(beyond == 0, 0.0, 1 / LIMIT_SPREAD)])


def velocities(body: Body, pose: Pose, solution: Solution) -> tuple[F64, F64]:
    """Return the vertices (V, 3) m of the scaled body and their velocities (V, 3, P + 6 + D)."""

    def at(shift: F64) -> tuple[Body, F64, F64, F64]:
        other = scaled(body, solution._replace(logs=solution.logs + shift).factors)
        joints, screws = kinematics.chain(other, pose)
        return other, kinematics.skin(other, joints, pose.angles), joints, screws

    now, points, joints, screws = at(np.zeros(len(solution.logs)))
    by_logs = [(at(step)[1] - at(-step)[1]) / (2 * STEP) for step in STEP * np.eye(len(solution.logs))]
    by_pose = kinematics.skin_velocities(now, joints, screws, pose.angles)
    return points, np.concatenate([*(rate[..., None] for rate in by_logs), by_pose], axis=2)
