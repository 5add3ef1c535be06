"""Pose, and cloth, from matches: twists, linear equations, Gauss–Newton (section 12.2.2)."""

from __future__ import annotations

from mocapflow.components import ClothFitter, PoseSolver
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_pose_solvers() -> list[type[PoseSolver]]:
    """Return the pose solvers of this plugin."""
    from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

    return [TwistGaussNewton]


@hookimpl
def mocapflow_cloth_fitters() -> list[type[ClothFitter]]:
    """Return the cloth fitters of this plugin."""
    from mocapflow_twist.gauss_newton import GaussNewton

    return [GaussNewton]
