"""Poses of many frames with shared proportions: the eliminated system is the whole one."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_fitting.pose_fit import Solution, _step

from mocapflow.data import Pose
from mocapflow.geometry import twists

SPREADS = {"height": 0.1, "legs": 0.05}


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("names", [(), ("height", "legs")])
def test_eliminating_the_poses_solves_the_whole_system(damping: float, names: tuple[str, ...]) -> None:
    random = np.random.default_rng(0)
    spreads, shared, unknowns = {name: SPREADS[name] for name in names}, len(names), 8
    blocks = []
    for _ in range(3):
        rows = random.normal(size=(30, shared + unknowns))
        blocks.append((rows.T @ rows, 1e-3 * random.normal(size=shared + unknowns)))
    logs = np.array([0.02, -0.01])[:shared]
    poses = tuple(Pose(root=twists.exp(random.normal(size=6)), angles=random.normal(size=2)) for _ in blocks)
    found = _step(blocks, Solution(spreads, logs, poses), damping)

    size = shared + unknowns * len(blocks)
    precision = np.array([sd**-2 for sd in spreads.values()])
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    matrix[:shared, :shared], vector[:shared] = np.diag(precision * (1 + damping)), precision * logs
    for k, (block, gradient) in enumerate(blocks):
        own = np.r_[:shared, shared + k * unknowns : shared + (k + 1) * unknowns]
        damped = block.copy()
        damped[range(shared, len(block)), range(shared, len(block))] *= 1 + damping
        matrix[np.ix_(own, own)] += damped
        vector[own] += gradient
    wanted = np.linalg.solve(matrix, -vector)
    assert found.logs - logs == pytest.approx(wanted[:shared])
    for k, (pose, before) in enumerate(zip(found.poses, poses, strict=True)):
        step = np.append(twists.log(pose.root @ twists.inverse(before.root)), pose.angles - before.angles)
        assert step == pytest.approx(wanted[shared + k * unknowns :][:unknowns], abs=1e-12)
