"""One damped, scaled and capped step of the normal equations."""

from __future__ import annotations

import numpy as np

from mocapflow.geometry import twists
from mocapflow.records import F64, Bool
from mocapflow_twist.normal_equations import Equations

ROOT_LEVER = 0.3  # m a radian of the root moves the surface: makes turning and shifting comparable
ANGLE_LEVER = 0.2  # m a radian of a joint moves the surface
CLOTH_LEVER = 0.1  # m the range of a cloth parameter moves the surface

RAISED, LOWERED = 10.0, 0.1  # what a rejected and an accepted step do to the damping


def levers(angles: int, ranges: F64) -> F64:
    """Return how far (m) a unit of each unknown moves the surface: (6 + D + Q,)."""
    return np.concatenate(
        [np.full(3, ROOT_LEVER), np.ones(3), np.full(angles, ANGLE_LEVER), CLOTH_LEVER / np.maximum(ranges, 1e-12)]
    )


def about_origin(centre: F64, unknowns: int) -> F64:
    """Return the matrix (S, S) that makes an increment about the world's origin of one about `centre` (3,) m."""
    matrix = np.eye(unknowns)
    matrix[3:6, :3] = twists.hat(centre)
    return matrix


def at_bound(parameters: F64, downhill: F64, low: F64, high: F64) -> Bool:
    """Return which parameters (Q,) stand at a bound and would leave it downhill, or have no way to go."""
    leaving = ((parameters <= low) & (downhill < 0)) | ((parameters >= high) & (downhill > 0))
    held: Bool = leaving | (low == high)
    return held


def step(equations: Equations, lever: F64, damping: float) -> F64:
    """Return the Levenberg–Marquardt step (S,); `damping` is relative to the mean diagonal in metres of surface.

    The equations are scaled to a unit diagonal first, so that unknowns of any unit are solved equally well.
    """
    diagonal = np.diag(equations.hessian)
    damped = diagonal + damping * float(np.mean(diagonal / lever**2)) * lever**2
    scale = 1.0 / np.sqrt(damped)
    matrix = equations.hessian * scale[:, None] * scale
    np.fill_diagonal(matrix, 1.0)
    return -scale * np.linalg.solve(matrix, scale * equations.gradient)


def capped(increment: F64, angles: int, max_angle: float, max_shift: float) -> F64:
    """Return an increment (S,) about the root, shortened until no angle (rad) and no shift (m) is too large."""
    turn, shift = np.linalg.norm(increment[:3]), np.linalg.norm(increment[3:6])
    bend = np.abs(increment[6 : 6 + angles]).max(initial=0.0)
    excess = max(1.0, turn / max_angle, bend / max_angle, shift / max_shift)
    shortened: F64 = increment / excess
    return shortened


def gain(equations: Equations, increment: F64) -> float:
    """Return by how much the quadratic model says that an increment lowers the energy."""
    return -float(equations.gradient @ increment + 0.5 * increment @ equations.hessian @ increment)
