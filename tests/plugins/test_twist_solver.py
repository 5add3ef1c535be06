"""Poses are found again, steps never make things worse, hidden limbs stay where they were (T-GEO3)."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_priors.rest_pose import RestPose
from mocapflow_twist.solver import TwistGaussNewton
from twist_fixtures import exact_matches, make_pose, make_scene, make_state

from mocapflow.data import Past, Pose, Turn, empty_matches
from mocapflow.geometry import twists
from mocapflow.model import ClothedModel

FREE = {"root_damping_m": 1e6, "root_damping_deg": 1e8, "angle_damping_deg": 1e8, "damping": 1e-12}
EXACT = {**FREE, "stop_surface_mm": 0.0, "stop_angle_deg": 0.0, "cap_deg": 60.0, "cap_mm": 500.0, "correlation_px": 0.0}
TURN = Turn(index=0, cap=8)


def start_from(truth: Pose, seed: int) -> Pose:
    """A pose 0.2 to 0.5 rad and 40 to 60 mm off."""
    rng = np.random.default_rng(seed)
    axis, shift = rng.normal(size=3), rng.normal(size=3)
    root = twists.exp(np.concatenate([axis / np.linalg.norm(axis) * rng.uniform(0.2, 0.5), np.zeros(3)]))
    root[:3, :3] = root[:3, :3] @ truth.root[:3, :3]
    root[:3, 3] = truth.root[:3, 3] + shift / np.linalg.norm(shift) * rng.uniform(0.04, 0.06)
    return Pose(root=root, angles=truth.angles + rng.choice([-1, 1], 12) * rng.uniform(0.2, 0.3, 12))


def largest_error_deg(pose: Pose, truth: Pose) -> float:
    turn = twists.log(pose.root @ twists.inverse(truth.root))[:3]
    return float(np.degrees(max(np.linalg.norm(turn), np.abs(pose.angles - truth.angles).max())))


@pytest.mark.parametrize("residual", ["image", "line"])
@pytest.mark.parametrize("seed", range(4))
def test_exact_matches_give_the_pose_within_seven_iterations(residual: str, seed: int) -> None:
    scene, truth = make_scene(), make_pose(seed)
    matches = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
    solver = TwistGaussNewton(iterations=7, residual=residual, **EXACT)
    start = make_state(start_from(truth, seed))
    estimate = solver.solve(lambda surface: matches, start, ClothedModel(scene=scene), [], Past(), TURN)
    assert largest_error_deg(estimate.pose, truth) < 1e-8
