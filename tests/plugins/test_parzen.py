"""The density of training poses: its slope, integral and bandwidth (T-PRI1); limbs nobody sees (T-PRI2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_priors.density import Density, bandwidth, log_density, read, write
from mocapflow_priors.parzen import SHIPPED, Parzen
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.problem import Anchor, Problem
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton
from pydantic import ValidationError
from twist_fixtures import exact_matches, make_pose, make_scene, make_state

from mocapflow.data import NO_CLOTH, Estimate, Matches, Past, Pose, Turn, empty_matches
from mocapflow.errors import PipelineError
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing import PriorConformance
from mocapflow.testing.scenes import tiny_scene

RNG = np.random.default_rng(0)
LEG = ("screw0", "screw1", "screw2", "screw3", "screw4")  # of the random body: joints 1 to 3


def gait(names: tuple[str, ...], count: int = 60) -> Density:
    """A closed curve of poses."""
    phase = np.linspace(0, 2 * np.pi, count, endpoint=False)
    poses = np.stack([0.5 * np.sin(phase + k) for k in range(len(names))], axis=1)
    return Density(names=names, poses=poses, bandwidth=bandwidth(poses))


class TestParzenConforms(PriorConformance):
    bounds_energy = True

    @pytest.fixture(autouse=True)
    def trained(self, tmp_path: Path) -> None:
        write(tmp_path / "poses.npz", gait(tiny_scene().body.screw_names))
        type(self).prior = Parzen(poses=tmp_path / "poses.npz")

    prior = Parzen()


def test_slope_of_the_density() -> None:
    """T-PRI1."""
    density, place, step = gait(("a", "b", "c")), np.array([0.3, -0.2, 0.9]), 1e-5
    _, mean = log_density(density, place)
    slope = [
        (log_density(density, place + step * axis)[0] - log_density(density, place - step * axis)[0]) / (2 * step)
        for axis in np.eye(3)
    ]
    assert (mean - place) / density.bandwidth**2 == pytest.approx(slope, rel=1e-8)


def test_the_density_integrates_to_one() -> None:
    """T-PRI1."""
    density = gait(("a", "b"))
    grid = np.linspace(-1.5, 1.5, 151)
    total = sum(np.exp(log_density(density, np.array([x, y]))[0]) for x in grid for y in grid)
    assert total * (grid[1] - grid[0]) ** 2 == pytest.approx(1.0, abs=1e-3)


def test_bandwidth_is_the_largest_distance_to_a_neighbour() -> None:
    """T-PRI1."""
    poses = RNG.normal(size=(40, 3))
    apart = np.linalg.norm(poses[:, None] - poses, axis=2) + 1e9 * np.eye(40)
    assert bandwidth(poses) == pytest.approx(apart.min(axis=1).max())
    assert bandwidth(poses, 50) == pytest.approx(np.median(apart.min(axis=1)))


def test_poses_on_both_sides_of_half_a_turn_are_neighbours() -> None:
    poses = np.array([[3.13], [3.135], [-3.138]])
    assert bandwidth(poses) == pytest.approx(2 * np.pi - 3.138 - 3.135)
    assert bandwidth(np.array([[-1e-20], [0.1]])) == pytest.approx(0.1)


def test_angles_wrap_and_far_poses_do_not_underflow() -> None:
    density = gait(("a", "b"))
    place = np.array([0.2, 0.1])
    near, far = log_density(density, place), log_density(density, place + 2 * np.pi)
    assert near[0] == pytest.approx(far[0])
    log_p, mean = log_density(density, np.array([2.9, -2.9]))
    assert np.isfinite(log_p)
    assert np.abs(mean).max() < 1.0


def without_the_leg(scene: Scene, truth: Pose) -> Matches:
    """Exact matches of what does not move with the leg."""
    leg = np.isin(scene.body.skin_joint, (1, 2, 3)) & (scene.body.skin_weight > 0)
    return exact_matches(scene, truth, np.flatnonzero(~leg.any(axis=1)), directed=False)


def test_the_solver_climbs_by_full_steps_to_the_mean(tmp_path: Path) -> None:
    """T-PRI2: one step of the pose solver at a time, while the limbs that are seen are found."""
    scene, truth = make_scene(), make_pose(1)
    poses = np.random.default_rng(2).normal(0, 0.4, (30, 5))
    write(tmp_path / "poses.npz", Density(names=LEG, poses=poses, bandwidth=0.3))
    prior, matches = Parzen(poses=tmp_path / "poses.npz"), without_the_leg(scene, truth)
    solver = TwistGaussNewton(iterations=1, angle_sd_deg=1e6, damping=1e-12, cap_deg=90.0, stop_sigmas=0.0)
    pose = Pose(root=truth.root, angles=np.r_[0.9, -0.8, 0.9, 0.7, -0.9, truth.angles[5:] + 0.1])
    heights = []
    for _ in range(25):
        log_p, mean = log_density(prior.density, pose.angles[:5])
        heights.append(log_p)
        state, model = make_state(pose), ClothedModel(scene=scene)
        pose = solver.solve(lambda _: matches, state, model, [prior], Past(), Turn(index=0)).pose
        np.testing.assert_allclose(pose.angles[:5], mean, atol=1e-5)
    assert (np.diff(heights) > -1e-9).all()
    assert heights[10] > heights[1] > heights[0] + 1
    np.testing.assert_allclose(pose.angles[5:], truth.angles[5:], atol=1e-6)


def test_an_unseen_leg_leaves_no_direction_free(tmp_path: Path) -> None:
    """T-PRI2: rank of the normal equations, and condition once each unknown is scaled; the root is the damping's."""
    scene, truth = make_scene(), make_pose(1)
    write(tmp_path / "poses.npz", gait(LEG))
    prior, model, solver = Parzen(poses=tmp_path / "poses.npz"), ClothedModel(scene=scene), TwistGaussNewton()
    guess, motion = Guess(truth, NO_CLOTH), ClothMotion(model, Past(), False)

    def equations(matches: Matches, priors: Sequence[Parzen], precision: F64) -> F64:
        data = solver._data(matches, model)
        found = Problem(motion, data, priors, Anchor(guess, precision), {}).quadratic(guess).total.hessian
        scale = 1 / np.sqrt(np.maximum(np.diag(found), 1e-12))
        return found * scale * scale[:, None]

    undamped, damped, seen = np.zeros(18), solver._anchor_precision(motion, guess), without_the_leg(scene, truth)
    ranks = [
        np.linalg.matrix_rank(equations(matches, priors, precision), tol=1e-9)
        for matches, priors, precision in (
            (seen, [], undamped), (seen, [prior], undamped),
            (empty_matches(), [prior], undamped), (empty_matches(), [prior], damped),
        )
    ]  # fmt: skip
    assert ranks == [13, 18, 5, 18]
    assert np.linalg.cond(equations(seen, [prior], undamped)) < 150  # it is 71


def test_an_unseen_leg_comes_to_rest_in_a_training_pose(tmp_path: Path) -> None:
    """T-PRI2."""
    scene, truth = make_scene(), make_pose(1)
    poses = np.tile([0.4, -0.3, 0.2, 0.5, 0.1], (6, 1)) + 0.01 * RNG.normal(size=(6, 5))
    write(tmp_path / "poses.npz", Density(names=LEG, poses=poses, bandwidth=0.1))
    solver, matches = TwistGaussNewton(angle_sd_deg=1e4), without_the_leg(scene, truth)

    def solved(*priors: Parzen) -> Estimate:
        state = make_state(Pose(root=truth.root, angles=np.full(12, 0.05)))
        return solver.solve(lambda _: matches, state, ClothedModel(scene=scene), priors, Past(), Turn(index=0))

    with_prior, without = solved(Parzen(poses=tmp_path / "poses.npz")), solved()
    np.testing.assert_allclose(with_prior.pose.angles[:5], poses.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(without.pose.angles[:5], 0.05, atol=1e-6)
    np.testing.assert_allclose(with_prior.pose.angles[5:], truth.angles[5:], atol=1e-4)
    spread, unknown = (np.sqrt(np.diag(estimate.covariance))[6:11] for estimate in (with_prior, without))
    assert (spread < 0.1 + 1e-9).all()
    assert (unknown > 100).all()  # rad: the damping alone


def test_training_poses_are_put_where_a_body_has_their_angles() -> None:
    density = Density(names=("knee", "hip"), poses=np.array([[0.1, 0.2], [0.3, 0.4]]), bandwidth=0.1)
    np.testing.assert_array_equal(density.on(["hip", "elbow", "knee"]), [[0.2, np.nan, 0.1], [0.4, np.nan, 0.3]])


def test_angles_the_body_lacks_are_left_out(tmp_path: Path) -> None:
    density = gait((*LEG, "tail.wag"))
    write(tmp_path / "poses.npz", density)
    scene, pose = make_scene(), make_pose(2)
    residual = Parzen(poses=tmp_path / "poses.npz").residual(pose, Past(), scene)
    log_p, _ = log_density(density.of(LEG), pose.angles[:5])
    assert residual.error.shape == (5,)
    assert residual.energy == pytest.approx(density.of(LEG).peak - log_p)
    bare = replace(scene, body=replace(scene.body, screw_names=tuple(f"other{k}" for k in range(12))))
    assert Parzen(poses=tmp_path / "poses.npz").residual(pose, Past(), bare).error.shape == (0,)


def test_the_shipped_poses_are_walks_squats_and_more() -> None:
    density = Parzen().density
    knees = np.degrees(density.poses[:, [density.names.index(f"knee_{side}.flexion") for side in "lr"]])
    assert {"hip_l.abduction", "shoulder_r.raise", "elbow_l.flexion"} < set(density.names)
    assert knees.min() > -25
    assert 60 < knees.max() < 140
    assert 5 < np.degrees(density.bandwidth) < 30


def test_a_file_of_something_else(tmp_path: Path) -> None:
    np.savez(tmp_path / "poses.npz", names=np.array(["knee_l.flexion"]))
    headless = (tmp_path / "poses.npz").read_bytes().replace(b"}", b" ")
    for content in (b"hello", b"", SHIPPED.read_bytes()[:2000], headless):
        (tmp_path / "poses.npz").write_bytes(content)
        with pytest.raises(PipelineError, match=r"this is no file of training poses"):
            read(tmp_path / "poses.npz")
    with pytest.raises(PipelineError, match=r"there is no such file of training poses"):
        read(tmp_path / "none.npz")
    density = read(SHIPPED)
    odd = [density.poses.copy() for _ in range(2)]
    odd[0][3, 4], odd[1][3, 4] = np.nan, 1000.0
    for poses in (*odd, density.poses[:0], density.poses[:, 1:]):  # none, and none of the first name
        write(tmp_path / "poses.npz", replace(density, poses=poses))
        with pytest.raises(PipelineError, match=r"no finite angles in radians, a column for each name"):
            read(tmp_path / "poses.npz")
    for wide in (-0.1, 0.0, np.nan, np.inf):
        write(tmp_path / "poses.npz", replace(density, bandwidth=wide))
        with pytest.raises(PipelineError, match=r"with a bandwidth above zero"):
            read(tmp_path / "poses.npz")
    with pytest.raises(ValidationError, match=r"none\.npz: there is no such file .*`mocapflow prior fit"):
        Parzen(poses=tmp_path / "none.npz")
