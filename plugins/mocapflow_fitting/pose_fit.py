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
from mocapflow_fitting.proportions import PROPORTIONS, scaled

FREE_SPREAD = np.radians(60.0)  # rad, of angles the body leaves free: unseen joints stay near rest
LIMIT_SPREAD = np.radians(2.0)  # rad, by how much an angle may pass a limit
CAUCHY = 2.0  # standard deviations at which the weight of an observation has halved
ENOUGH = 1e-6  # share of the cost below which a gain is none
NEAREST = 0.1  # m, depth below which a projection is not believed
STEP = 1e-4  # of what is shared, for differences

# What is fitted, with its standard deviation about zero: logarithms of proportions, m by which joints turn elsewhere,
# deviations along modes of a shape.
Spreads = Mapping[str, float]


class Residuals(NamedTuple):
    """By how much N points are off what was observed of them, in m components each: px or m."""

    error: F64  # (N, m)
    slope: F64  # (N, m, 3) their derivatives by the place of the point
    point: I32  # (N,) which vertex of the body that is
    precision: F64  # (N,) one over the standard deviation


class Observations(NamedTuple):
    """What was observed of one moment."""

    body: Body  # its vertices are the points, before scaling
    compare: Callable[[F64], Residuals]  # of the points (V, 3) m


class Solution(NamedTuple):
    """What all moments share, and the pose of each."""

    spreads: Spreads  # of what is shared, in its order
    shared: F64  # (P,) values of these
    poses: tuple[Pose, ...]

    @property
    def factors(self) -> Mapping[str, float]:
        """The proportions, where joints turn, and the deviations of the shape, by name."""
        values = zip(self.spreads, self.shared.tolist(), strict=True)
        return {name: math.exp(value) if name in PROPORTIONS else value for name, value in values}


class NormalEquations(NamedTuple):
    """Those of one moment over (shared, root, angles), S = P + 6 + D."""

    matrix: F64  # (S, S)
    gradient: F64  # (S,)


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


def descend(moments: Sequence[Observations], solution: Solution, rounds: int = 80) -> Solution:
    """Levenberg-Marquardt over all moments at once; the poses are eliminated one by one (Schur complement)."""
    damping, cost = 1e-3, _cost(moments, solution)
    for _ in range(rounds):
        equations = [_normal(moment, pose, solution) for moment, pose in zip(moments, solution.poses, strict=True)]
        while damping < 1e8:
            trial = _step(equations, solution, damping)
            lower = _cost(moments, trial)
            if lower <= cost:
                break
            damping *= 8
        else:
            return solution
        gain, cost, solution, damping = cost - lower, lower, trial, max(damping / 5, 1e-9)
        if gain < ENOUGH * cost:
            return solution
    return solution


def _step(equations: Sequence[NormalEquations], solution: Solution, damping: float) -> Solution:
    """Return the solution after one damped step: first of what is shared, the poses eliminated, then of each pose."""
    count = len(solution.shared)
    precision = np.array([1 / sd**2 for sd in solution.spreads.values()])
    left, right = np.diag(precision * (1 + damping)), -precision * solution.shared
    eliminated = []  # of each moment: how its pose follows what is shared (6 + D, P), and where it goes by itself
    for matrix, gradient in equations:
        pose = matrix[count:, count:] + damping * np.diag(np.diag(matrix[count:, count:]))
        both = np.linalg.solve(pose, np.column_stack([matrix[count:, :count], -gradient[count:]]))
        left = left + matrix[:count, :count] - matrix[:count, count:] @ both[:, :count]
        right = right - gradient[:count] - matrix[:count, count:] @ both[:, -1]
        eliminated.append(both)
    shared = np.linalg.solve(left, right) if count else np.empty(0)
    steps = [np.asarray(both[:, -1] - both[:, :count] @ shared, np.float64) for both in eliminated]
    poses = tuple(moved(pose, step) for pose, step in zip(solution.poses, steps, strict=True))
    return solution._replace(shared=solution.shared + shared, poses=poses)


def _normal(moment: Observations, pose: Pose, solution: Solution) -> NormalEquations:
    points, moves = velocities(moment.body, pose, solution)
    residuals = moment.compare(points)
    jacobian = np.einsum("nmi,nis->nms", residuals.slope, moves[residuals.point])
    weight = residuals.precision**2 / (1 + _squared(residuals) / CAUCHY**2)
    rows = (np.sqrt(weight)[:, None, None] * jacobian).reshape(-1, moves.shape[2])
    errors = (np.sqrt(weight)[:, None] * residuals.error).ravel()
    matrix, gradient = rows.T @ rows, rows.T @ errors
    angles = slice(len(solution.shared) + 6, None)
    error, precision = _prior(moment.body, pose.angles)
    matrix[angles, angles] += np.diag((precision**2).sum(axis=0))
    gradient[angles] += (precision**2 * error).sum(axis=0)
    return NormalEquations(matrix + 1e-6 * np.eye(len(gradient)), gradient)


def _cost(moments: Sequence[Observations], solution: Solution) -> float:
    cost = 0.5 * sum((value / sd) ** 2 for value, sd in zip(solution.shared, solution.spreads.values(), strict=True))
    for moment, pose in zip(moments, solution.poses, strict=True):
        body = scaled(moment.body, solution.factors)
        residuals = moment.compare(kinematics.skin(body, kinematics.chain(body, pose)[0], pose.angles))
        error, precision = _prior(body, pose.angles)
        cost += 0.5 * CAUCHY**2 * np.log1p(_squared(residuals) / CAUCHY**2).sum()
        cost += 0.5 * ((precision * error) ** 2).sum()
    return float(cost)


def _squared(residuals: Residuals) -> F64:
    """Return the squared residuals (N,) in variances."""
    return np.asarray((residuals.error**2).sum(axis=1) * residuals.precision**2)


def _prior(body: Body, angles: F64) -> tuple[F64, F64]:
    """Return errors (2, D) and 1/sd (2, D): distance from rest, and beyond the limits."""
    beyond = angles - np.clip(angles, *body.limits.T)
    spread = np.where(np.isfinite(body.rest_spread), body.rest_spread, FREE_SPREAD)
    return np.stack([angles, beyond]), np.stack([1 / spread, np.where(beyond == 0, 0.0, 1 / LIMIT_SPREAD)])


def velocities(body: Body, pose: Pose, solution: Solution) -> tuple[F64, F64]:
    """Return the vertices (V, 3) m of the scaled body and their velocities (V, 3, P + 6 + D)."""

    def at(shift: F64) -> tuple[Body, F64, F64, F64]:
        other = scaled(body, solution._replace(shared=solution.shared + shift).factors)
        joints, screws = kinematics.chain(other, pose)
        return other, kinematics.skin(other, joints, pose.angles), joints, screws

    now, points, joints, screws = at(np.zeros(len(solution.shared)))
    by_shared = [(at(step)[1] - at(-step)[1]) / (2 * STEP) for step in STEP * np.eye(len(solution.shared))]
    by_pose = kinematics.skin_velocities(now, joints, screws, pose.angles)
    return points, np.concatenate([*(rate[..., None] for rate in by_shared), by_pose], axis=2)
