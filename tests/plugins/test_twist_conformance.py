"""The pose solver keeps to its role."""

from __future__ import annotations

from mocapflow_twist.solver import TwistGaussNewton

from mocapflow.testing import PoseSolverConformance


class TestImageResidual(PoseSolverConformance):
    pose_solver = TwistGaussNewton()


class TestLineResidual(PoseSolverConformance):
    pose_solver = TwistGaussNewton(residual="line", steps_per_match=4)
