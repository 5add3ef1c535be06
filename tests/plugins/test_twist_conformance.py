"""The pose solver keeps to its role with the other residual, too; test_conformance has it as it is."""

from __future__ import annotations

from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow.testing import PoseSolverConformance


class TestLineResidual(PoseSolverConformance):
    pose_solver = TwistGaussNewton(residual="line", steps_per_match=4)
