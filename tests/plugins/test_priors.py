"""Priors: derivatives, where they act and where they don't."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_priors.rest_pose import RestPose
from mocapflow_priors.smooth_motion import SmoothMotion, turn_rate
from mocapflow_priors.spine_coupling import SpineCoupling
from twist_fixtures import make_pose, make_scene

from mocapflow.components import Prior
from mocapflow.data import NO_CLOTH, Moment, Past, Pose
from mocapflow.geometry import twists
from mocapflow.geometry.kinematics import root_position
from mocapflow.model import moved


def make_past(first: Pose, second: Pose, step: float = 1 / 30) -> Past:
    return Past(moments=tuple(Moment(time=k * step, pose=p, cloth=NO_CLOTH) for k, p in enumerate((first, second))))


@pytest.mark.parametrize("prior", [JointLimits(), RestPose(), SmoothMotion()])
@pytest.mark.parametrize("seed", range(3))
def test_derivatives(prior: Prior, seed: int) -> None:
    scene, pose = make_scene(), make_pose(seed, angle=1.5)
    past = make_past(make_pose(10), make_pose(11))
    residual, step, unknowns = prior.residual(pose, past, scene), 1e-5, 18
    errors = [[prior.residual(moved(pose, s * step * c), past, scene).error for s in (1, -1)] for c in np.eye(unknowns)]
    numeric = np.stack([(ahead - behind) / (2 * step) for ahead, behind in errors], axis=1)
    assert np.abs(residual.jacobian - numeric).max() < 1e-6 * np.abs(numeric).max()
    assert residual.energy == pytest.approx(0.5 * residual.error @ residual.error)


def test_limits_are_silent_inside_and_grow_outside() -> None:
    scene, pose = make_scene(), make_pose(0)
    low, high = scene.body.limits.T

    def error(angles: np.ndarray) -> np.ndarray:
        return JointLimits().residual(Pose(root=pose.root, angles=angles), Past(), scene).error

    assert not error(low).any() and not error(0.5 * (low + high)).any() and not error(high).any()
    assert error(high + np.radians(2)) == pytest.approx(0.5)  # slack and sd are both 2 degrees
    assert error(low - np.radians(2)) == pytest.approx(-0.5)
    assert error(high + np.radians(30)) == pytest.approx(14, rel=0.01)


def test_unlimited_angles_have_no_wall() -> None:
    scene = make_scene()
    free = replace(scene, body=replace(scene.body, limits=np.tile([-np.inf, np.inf], (12, 1))))
    residual = JointLimits().residual(make_pose(0, 3.0), Past(), free)
    assert residual.energy == 0 and np.isfinite(residual.jacobian).all()


def test_only_stiff_angles_are_held_at_rest() -> None:
    scene, pose = make_scene(), make_pose(0)
    residual = RestPose().residual(pose, Past(), scene)
    stiff = np.isfinite(scene.body.rest_spread)
    assert residual.error == pytest.approx(pose.angles[stiff] / scene.body.rest_spread[stiff])


def test_smooth_motion_expects_the_last_motion_again() -> None:
    scene, first = make_scene(), make_pose(0)
    step = np.concatenate([[0.01, 0.02, -0.03, 0.01, 0.0, 0.02], np.full(12, 0.05)])
    second, third = moved(first, step), moved(moved(first, step), step)
    prior = SmoothMotion()
    assert prior.residual(third, make_past(first, second), scene).energy == pytest.approx(0, abs=1e-20)
    bent = Pose(root=third.root, angles=third.angles + np.radians(5))
    assert prior.residual(bent, make_past(first, second), scene).error[6:] == pytest.approx(1.0)
    slower = prior.residual(bent, make_past(first, second, step=1 / 15), scene)
    assert slower.error[6:] == pytest.approx(0.25)


def test_smooth_motion_counts_root_turns_and_shifts_in_their_deviations() -> None:
    scene, first = make_scene(), make_pose(0)
    prior, past = SmoothMotion(root_sd_deg=3.0, root_sd_mm=10.0), make_past(first, first)
    joint = root_position(scene.body, first.root)
    turn = np.append(twists.screw(np.array([0.0, 0.0, 1.0]), joint) * np.radians(3), np.zeros(12))
    shift = np.append([0.0, 0.0, 0.0, 0.0, 0.01, 0.0], np.zeros(12))
    for step, row in ((turn, 2), (shift, 4)):
        assert prior.residual(moved(first, step), past, scene).error == pytest.approx(np.eye(18)[row], abs=1e-9)


def test_smooth_motion_says_nothing_without_two_frames_or_time_between_them() -> None:
    scene, pose = make_scene(), make_pose(0)
    one = Past(moments=(Moment(time=0.0, pose=pose, cloth=NO_CLOTH),))
    for past in (Past(), one, make_past(pose, make_pose(1), step=0.0)):
        assert SmoothMotion().residual(pose, past, scene).jacobian.shape == (0, 18)


def test_a_half_turn_between_pose_and_expectation_is_finite() -> None:
    scene, pose = make_scene(), make_pose(0)
    turned = Pose(root=pose.root @ twists.exp(np.array([0, 0, np.pi, 0, 0, 0])), angles=pose.angles)
    assert np.isfinite(SmoothMotion().residual(turned, make_past(pose, pose), scene).jacobian).all()


@pytest.mark.parametrize("angle", [0.0, 9e-5, 1.1e-4, 0.3, 2.0])
def test_the_rate_of_a_rotation_vector_inverts_that_of_its_exponential(angle: float) -> None:
    """Against the series of the left Jacobian, the sum over w^n / (n + 1)!."""
    w = angle * twists.hat(np.array([0.6, 0.0, 0.8]))
    term, left = np.eye(3), np.eye(3)
    for n in range(1, 30):
        term = term @ w / (n + 1)
        left = left + term
    np.testing.assert_allclose(turn_rate(angle * np.array([0.6, 0.0, 0.8])) @ left, np.eye(3), atol=2e-8)


def test_the_spine_bends_like_the_chest() -> None:
    scene, pose = make_scene(), make_pose(0)
    body = replace(scene.body, screw_names=("spine.flexion", "chest.flexion", *scene.body.screw_names[2:]))
    residual = SpineCoupling(sd_deg=4).residual(pose, Past(), replace(scene, body=body))
    assert residual.error == pytest.approx((pose.angles[0] - pose.angles[1]) / np.radians(4))
    assert np.flatnonzero(residual.jacobian[0]).tolist() == [6, 7]
    assert not len(SpineCoupling().residual(pose, Past(), scene).error)


@pytest.mark.parametrize("names", [("spine.flexion", "chest.twist"), ("spine2.flexion", "chest.flexion")])
def test_angles_of_other_names_or_joints_are_not_held_together(names: tuple[str, str]) -> None:
    scene = make_scene()
    body = replace(scene.body, screw_names=(*names, *scene.body.screw_names[2:]))
    assert not len(SpineCoupling().residual(make_pose(0), Past(), replace(scene, body=body)).error)
