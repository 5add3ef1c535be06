"""Poses of many frames with shared proportions: the eliminated system is the whole one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_fitting.pose_fit import (
    NEAREST,
    NormalEquations,
    Observations,
    Residuals,
    Solution,
    _cost,
    _normal,
    _step,
    projected,
)

from mocapflow.data import Pose
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.cameras import projections
from mocapflow.model import moved
from mocapflow.records import F64
from mocapflow.testing import tiny_pose, tiny_scene

SPREADS = {"height": 0.1, "legs": 0.05}


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("names", [(), ("height", "legs")])
def test_eliminating_the_poses_solves_the_whole_system(damping: float, names: tuple[str, ...]) -> None:
    random = np.random.default_rng(0)
    spreads, shared, unknowns = {name: SPREADS[name] for name in names}, len(names), 8
    blocks = []
    for _ in range(3):
        rows = random.normal(size=(30, shared + unknowns))
        blocks.append(NormalEquations(rows.T @ rows, 1e-3 * random.normal(size=shared + unknowns)))
    values = np.array([0.02, -0.01])[:shared]
    poses = tuple(Pose(root=twists.exp(random.normal(size=6)), angles=random.normal(size=2)) for _ in blocks)
    found = _step(blocks, Solution(spreads, values, poses), damping)

    size = shared + unknowns * len(blocks)
    precision = np.array([sd**-2 for sd in spreads.values()])
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    matrix[:shared, :shared], vector[:shared] = np.diag(precision * (1 + damping)), precision * values
    for k, (block, gradient) in enumerate(blocks):
        own = np.r_[:shared, shared + k * unknowns : shared + (k + 1) * unknowns]
        damped = block.copy()
        damped[range(shared, len(block)), range(shared, len(block))] *= 1 + damping
        matrix[np.ix_(own, own)] += damped
        vector[own] += gradient
    wanted = np.linalg.solve(matrix, -vector)
    assert found.shared - values == pytest.approx(wanted[:shared])
    for k, (pose, before) in enumerate(zip(found.poses, poses, strict=True)):
        step = np.append(twists.log(pose.root @ twists.inverse(before.root)), pose.angles - before.angles)
        assert step == pytest.approx(wanted[shared + k * unknowns :][:unknowns], abs=1e-12)


def test_the_gradient_is_that_of_the_cost() -> None:
    """By central differences; some errors are large, some angles beyond their limits."""
    scene, random = tiny_scene(), np.random.default_rng(2)
    body, pose = scene.body, tiny_pose(scene, 3, 0.4)
    tight = replace(body, limits=np.where(np.arange(len(body.limits))[:, None] % 2, 0.5 * body.limits, [-0.01, 0.01]))
    beyond = (pose.angles < tight.limits[:, 0]) | (pose.angles > tight.limits[:, 1])
    assert 0 < beyond.sum() < len(beyond)
    points = np.arange(0, len(body.vertices), 40, dtype=np.int32)
    target = kinematics.skin(body, kinematics.chain(body, pose)[0], pose.angles)[points]
    target += random.normal(scale=0.03, size=target.shape)
    slope, precision = np.broadcast_to(np.eye(3), (len(points), 3, 3)), random.uniform(20, 80, len(points))

    def compare(vertices: F64) -> Residuals:
        return Residuals(vertices[points] - target, slope, points, precision)

    def cost(step: F64) -> float:
        return _cost([moment], Solution({}, np.empty(0), (moved(pose, step),)))

    moment, steps = Observations(tight, compare), 1e-6 * np.eye(6 + len(pose.angles))
    numeric = [(cost(step) - cost(-step)) / 2e-6 for step in steps]
    matrix, gradient = _normal(moment, pose, Solution({}, np.empty(0), (pose,)))
    np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-3)
    assert (np.linalg.eigvalsh(matrix) > 0).all()


def test_projections_and_their_derivatives() -> None:
    scene = tiny_scene()
    points = np.array([[0.1, 0.2, 1.0], [-0.3, 0.1, 0.4]])
    matrices = projections(scene.cameras)[:2]
    pixel, slope, depth = projected(points, matrices)
    whole = np.einsum("nab,nb->na", matrices, np.column_stack([points, np.ones(2)]))
    np.testing.assert_allclose(np.column_stack([pixel, np.ones(2)]) * depth[:, None], whole)
    for axis, step in enumerate(1e-6 * np.eye(3)):
        numeric = (projected(points + step, matrices)[0] - projected(points - step, matrices)[0]) / 2e-6
        np.testing.assert_allclose(slope[:, :, axis], numeric, rtol=1e-4, atol=1e-4)
    behind = -matrices[:, 2, :3] * (whole[:, 2:] + 1.0) / (matrices[:, 2, :3] ** 2).sum(axis=1, keepdims=True)
    np.testing.assert_array_equal(projected(points + behind, matrices)[2], NEAREST)
