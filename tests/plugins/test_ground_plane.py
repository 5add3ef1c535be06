"""The floor: silent above, pushing below, with exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mocapflow_priors.ground_plane import GroundPlane
from twist_fixtures import make_body, make_pose, make_scene

from mocapflow.data import Past, Pose
from mocapflow.geometry import kinematics
from mocapflow.model import moved

FEET = ("joint3", "joint5")


def floor(height: float) -> GroundPlane:
    return GroundPlane(height_m=height, parts=FEET)


def lowest(pose: Pose) -> list[float]:
    body = make_body()
    joints, _ = kinematics.chain(body, pose)
    height = kinematics.skin(body, joints, pose.angles)[:, 2]
    carrier = body.skin_joint[np.arange(len(height)), body.skin_weight.argmax(axis=1)]
    return [height[carrier == body.joint(name)].min() for name in FEET]


def test_it_is_silent_above_and_grows_below() -> None:
    scene, pose = make_scene(), make_pose(0)
    feet = lowest(pose)
    assert not floor(min(feet) - 0.01).residual(pose, Past(), scene).error.any()
    error = floor(max(feet) + 0.1).residual(pose, Past(), scene).error
    depth = max(feet) + 0.1 - np.array(feet)
    np.testing.assert_allclose(error, depth**2 / (depth + 0.005) / 0.01, rtol=1e-12)


def test_derivatives() -> None:
    scene, pose, step = make_scene(), make_pose(1), 1e-6
    prior = floor(max(lowest(pose)) + 0.1)
    residual = prior.residual(pose, Past(), scene)
    errors = [[prior.residual(moved(pose, s * step * c), Past(), scene).error for s in (1, -1)] for c in np.eye(18)]
    numeric = np.stack([(ahead - behind) / (2 * step) for ahead, behind in errors], axis=1)
    np.testing.assert_allclose(residual.jacobian, numeric, atol=1e-6 * np.abs(numeric).max())


def test_a_body_without_feet_has_no_rows() -> None:
    scene = make_scene()
    bare = replace(scene, body=replace(scene.body, joint_names=tuple(f"other{k}" for k in range(8))))
    assert floor(1e3).residual(make_pose(0), Past(), bare).error.shape == (0,)
