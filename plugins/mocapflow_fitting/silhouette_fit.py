"""Poses and shared proportions that explain silhouettes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from mocapflow.assets import Body, Camera
from mocapflow.data import Matches, Pose
from mocapflow.geometry.cameras import projections
from mocapflow.geometry.kinematics import part_of
from mocapflow.records import F64, I32
from mocapflow_fitting.pose_fit import Observations, Residuals, Solution, descend, projected
from mocapflow_fitting.proportions import scaled

STEPS = 4  # Gauss-Newton steps between two matchings

Match = Callable[[Body, Pose], Matches]  # pairs of one moment for a body in a pose


def refine(
    body: Body, matchers: Sequence[Match], solution: Solution, cameras: Sequence[Camera], independent: float,
    rounds: int,
) -> Solution:  # fmt: skip
    """Return the solution with which the contours of the body meet those in the images.

    Args:
        body: before scaling.
        matchers: per moment, how contours are paired.
        solution: where to start.
        cameras: pinhole cameras.
        independent: share of the pairs that count, as the errors of neighbouring contour points agree.
        rounds: times that contours are paired anew.
    """
    for _ in range(rounds):
        now = scaled(body, solution.factors)
        pairs = [match(now, pose) for match, pose in zip(matchers, solution.poses, strict=True)]
        moments = [paired(body, found, cameras, independent) for found in pairs]
        solution = descend(moments, solution, STEPS)
    return solution


def paired(body: Body, matches: Matches, cameras: Sequence[Camera], independent: float) -> Observations:
    """Return matches as observations of the skin vertices that take part; those with the garment are left out."""
    own = matches.vertex < len(body.vertices)
    vertices, point = np.unique(matches.vertex[own], return_inverse=True)
    matrices = projections(cameras)[matches.camera[own]]
    along = matches.direction[own]
    free = np.all(along == 0, axis=1).astype(np.float64)
    onto = along[:, :, None] * along[:, None, :] + free[:, None, None] * np.eye(2)
    precision = np.sqrt(independent * matches.weight[own])
    compare = partial(_compare, matrices, matches.pixel[own], onto, point.astype(np.int32), precision)
    return Observations(part_of(body, vertices), compare)


def _compare(matrices: F64, pixel: F64, onto: F64, point: I32, precision: F64, points: F64) -> Residuals:
    at, slope, _ = projected(points[point], matrices)
    error = np.einsum("nab,nb->na", onto, at - pixel)
    return Residuals(error, np.einsum("nab,nbi->nai", onto, slope), point, precision)
