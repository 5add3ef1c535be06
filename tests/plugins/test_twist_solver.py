"""Poses are found again, steps never make things worse, hidden limbs stay where they were (T-GEO3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_priors.rest_pose import RestPose
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.problem import Anchor, Problem
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton, with_neutral_cloth
from twist_fixtures import exact_matches, make_pose, make_scene, make_state

from mocapflow.components import Prior
from mocapflow.data import NO_CLOTH, Estimate, FrameState, Matches, Moment, Past, Pose, Turn, empty_matches
from mocapflow.geometry import kinematics, twists
from mocapflow.model import ClothedModel
from mocapflow.scene import Scene

FREE = {"root_sd_m": 1e6, "root_sd_deg": 1e8, "angle_sd_deg": 1e8, "damping": 1e-12}
EXACT = {**FREE, "stop_sigmas": 0.0, "cap_deg": 60.0, "cap_mm": 500.0, "correlation_px": 0.0}
TURN = Turn(index=0)
DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"
HIDDEN = [9, 10, 11]  # the screws of joints 6 and 7


def solve(solver: TwistGaussNewton, scene: Scene, start: Pose, matches: Matches, priors: list[Prior] | None = None):
    return solver.solve(lambda _: matches, make_state(start), ClothedModel(scene=scene), priors or [], Past(), TURN)


def energies_of(
    solver: TwistGaussNewton,
    model: ClothedModel,
    matches: Matches,
    state: FrameState,
    found: Estimate,
    priors: Sequence[Prior] = (),
) -> Mapping[str, float]:
    """What an estimate costs by the matches it was found with, and where the solve began."""
    start = Guess(state.estimate.pose, state.cloth)
    motion = ClothMotion(model, Past(), solver.cloth_unknowns)
    anchor = Anchor(with_neutral_cloth(start, model), solver._anchor_precision(motion, start))
    problem = Problem(motion, solver._data(matches, model), priors, anchor, {})
    return problem.energies(Guess(found.pose, model.drape(found.pose, found.parameters, Past())))


def start_from(truth: Pose, seed: int) -> Pose:
    """A pose 0.2 to 0.5 rad and 40 to 60 mm off."""
    rng = np.random.default_rng(seed)
    axis, shift = rng.normal(size=3), rng.normal(size=3)
    root = twists.exp(np.concatenate([axis / np.linalg.norm(axis) * rng.uniform(0.2, 0.5), np.zeros(3)]))
    root[:3, :3] = root[:3, :3] @ truth.root[:3, :3]
    root[:3, 3] = truth.root[:3, 3] + shift / np.linalg.norm(shift) * rng.uniform(0.04, 0.06)
    count = len(truth.angles)
    return Pose(root=root, angles=truth.angles + rng.choice([-1, 1], count) * rng.uniform(0.2, 0.3, count))


def largest_error_deg(pose: Pose, truth: Pose) -> float:
    turn = twists.log(pose.root @ twists.inverse(truth.root))[:3]
    return float(np.degrees(max(np.linalg.norm(turn), np.abs(pose.angles - truth.angles).max())))


def visible_vertices(scene: Scene) -> np.ndarray:
    """Vertices that do not move with the hidden limb."""
    below = kinematics.descendants(scene.body.parents)[6]
    moves = (below[scene.body.skin_joint] & (scene.body.skin_weight > 0)).any(axis=1)
    return np.flatnonzero(~moves)


@pytest.mark.parametrize("residual", ["image", "line"])
@pytest.mark.parametrize("seed", range(4))
def test_exact_matches_give_the_pose_within_seven_iterations(residual: str, seed: int) -> None:
    scene, truth = make_scene(), make_pose(seed)
    matches = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
    solver = TwistGaussNewton(iterations=7, residual=residual, **EXACT)
    assert largest_error_deg(solve(solver, scene, start_from(truth, seed), matches).pose, truth) < 1e-8


def test_a_step_below_what_the_pose_is_known_to_is_not_taken() -> None:
    scene, truth = make_scene(), make_pose(1)
    matches = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
    start = Pose(root=truth.root, angles=truth.angles + np.radians(0.01))
    stop = {**EXACT, "iterations": 1}
    assert solve(TwistGaussNewton(**{**stop, "stop_sigmas": 1.0}), scene, start, matches).pose is start
    assert solve(TwistGaussNewton(**{**stop, "stop_sigmas": 1e-6}), scene, start, matches).pose is not start


def test_only_the_first_frame_starts_gently() -> None:
    scene, truth = make_scene(), make_pose(1)
    matches, start = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False), start_from(truth, 1)
    solver = TwistGaussNewton(**{**EXACT, "iterations": 1}, first_damping=1.0)
    later = Past(moments=(Moment(time=0.0, pose=start, cloth=NO_CLOTH),))
    model = ClothedModel(scene=scene)
    first, second, free = (
        largest_error_deg(solver.solve(lambda _: matches, make_state(start), model, [], past, turn).pose, start)
        for past, turn in ((Past(), TURN), (Past(), replace(TURN, index=1)), (later, TURN))
    )
    assert first < second < free


def test_only_a_frame_that_began_far_off_looks_for_matches_more_often() -> None:
    scene, truth = make_scene(), make_pose(1)
    matches, start = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False), start_from(truth, 1)
    solver = TwistGaussNewton(**{**EXACT, "iterations": 1}, far_iterations=3)
    later = Past(moments=(Moment(time=0.0, pose=start, cloth=NO_CLOTH),))
    for far, wanted in ((True, 3), (False, 1)):
        looked, turn = Mock(return_value=matches), replace(TURN, far=far)
        solver.solve(looked, make_state(start), ClothedModel(scene=scene), [], later, turn)
        assert looked.call_count == wanted


def test_matches_that_count_along_a_direction_only_give_the_pose_too() -> None:
    scene, truth = make_scene(), make_pose(1)
    matches = exact_matches(scene, truth, np.arange(0, 300, 3), directed=True)
    assert largest_error_deg(solve(TwistGaussNewton(**EXACT), scene, start_from(truth, 1), matches).pose, truth) < 1e-8


def test_the_chapters_literal_settings_reach_the_pose() -> None:
    scene, truth = make_scene(), make_pose(1)
    matches = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
    literal = TwistGaussNewton(residual="line", steps_per_match=4, **{**FREE, "damping": 1e-4})
    assert largest_error_deg(solve(literal, scene, start_from(truth, 1), matches).pose, truth) < 0.01


@pytest.mark.parametrize("residual", ["image", "line"])
def test_pairs_of_little_weight_pull_little(residual: str) -> None:
    """As a robust loss leaves them: every fifth lies 100 px aside."""
    scene, truth = make_scene(), make_pose(1)
    matches = exact_matches(scene, truth, np.arange(0, 300, 3), directed=False)
    stray = np.arange(len(matches.weight)) % 5 == 0
    wrong = replace(matches, pixel=matches.pixel + 100.0 * stray[:, None])
    off = []
    for weight in (1.0, 1e-3):
        doubted = replace(wrong, weight=np.where(stray, weight, 1.0))
        pose = solve(TwistGaussNewton(residual=residual, **EXACT), scene, truth, doubted).pose
        off.append(largest_error_deg(pose, truth))
    assert off[1] < 0.01 * off[0]


def test_the_scanned_person_is_found_again() -> None:
    body = Scanned().load(DEMO)
    scene = replace(make_scene(), body=body)
    rng = np.random.default_rng(0)
    bend = np.where(np.isfinite(body.rest_spread), 0.02, 0.2)
    truth = Pose(root=make_pose(0).root, angles=rng.normal(size=len(body.twists)) * bend)
    start = Pose(root=twists.exp(np.full(6, 0.02)) @ truth.root, angles=truth.angles + rng.normal(size=len(bend)) * 0.1)
    matches = exact_matches(scene, truth, rng.choice(len(body.vertices), 500, replace=False), directed=True)
    assert largest_error_deg(solve(TwistGaussNewton(**EXACT), scene, start, matches).pose, truth) < 1e-8


def test_a_hidden_limb_stays_and_is_unsure() -> None:
    scene, truth = make_scene(), make_pose(2)
    matches = exact_matches(scene, truth, visible_vertices(scene), directed=True)
    start = Pose(root=truth.root, angles=truth.angles + 0.1)
    estimate = solve(TwistGaussNewton(), scene, start, matches)
    seen = np.setdiff1d(np.arange(12), HIDDEN)
    assert np.allclose(estimate.pose.angles[HIDDEN], start.angles[HIDDEN], atol=1e-9)
    assert np.degrees(np.abs(estimate.pose.angles - truth.angles)[seen]).max() < 0.05
    sd = np.degrees(np.sqrt(np.diag(estimate.covariance)))[6:]
    assert sd[HIDDEN] == pytest.approx(60.0, rel=1e-6) and sd[seen].max() < 2
    assert estimate.observed[HIDDEN].max() < 1e-9 and estimate.observed[seen].min() > 0.99


def test_a_hidden_limb_goes_where_a_prior_puts_it() -> None:
    """T-PRI2."""
    scene, truth = make_scene(), make_pose(2)
    matches = exact_matches(scene, truth, visible_vertices(scene), directed=True)
    estimate = solve(TwistGaussNewton(), scene, truth, matches, [RestPose()])
    stiff = [d for d in HIDDEN if np.isfinite(scene.body.rest_spread[d])]
    assert np.abs(estimate.pose.angles[stiff]).max() < 0.01
    assert np.sqrt(np.diag(estimate.covariance))[6:][stiff] == pytest.approx(scene.body.rest_spread[stiff], rel=0.02)
    assert estimate.observed[HIDDEN].max() < 1e-9


def test_without_matches_the_prediction_stays_with_the_priors_covariance() -> None:
    scene, start = make_scene(), make_pose(4)
    nothing = replace(exact_matches(scene, start, np.arange(9), True), weight=np.zeros(36))
    for matches in (empty_matches(), nothing):
        solver, model = TwistGaussNewton(), ClothedModel(scene=scene)
        estimate = solve(solver, scene, start, matches, [JointLimits(), RestPose()])
        assert np.array_equal(estimate.pose.root, start.root) and np.array_equal(estimate.pose.angles, start.angles)
        sd = np.sqrt(np.diag(estimate.covariance))
        free = np.isinf(scene.body.rest_spread) & (np.abs(start.angles) < 1)
        assert np.degrees(sd[6:][free]) == pytest.approx(60.0)
        assert np.isfinite(estimate.covariance).all()
        assert energies_of(solver, model, matches, make_state(start), estimate)["data"] == 0
        assert np.abs(estimate.observed).max() < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_a_solve_never_ends_worse_than_it_began(seed: int) -> None:
    scene, truth = make_scene(), make_pose(seed)
    rng = np.random.default_rng(seed)
    matches = exact_matches(scene, truth, np.arange(0, 300, 11), directed=bool(seed % 2))
    wrong = replace(matches, pixel=matches.pixel + rng.normal(size=matches.pixel.shape) * rng.choice([1, 200]))
    start, priors = make_pose(seed + 100, angle=0.9), [JointLimits(), RestPose()]
    model, still = ClothedModel(scene=scene), TwistGaussNewton(iterations=1, cap_deg=1e-9, cap_mm=1e-9)
    energies = []
    for solver in (still, *(TwistGaussNewton(iterations=n) for n in (1, 2, 4, 8))):
        found = solve(solver, scene, start, wrong, priors)
        energies.append(sum(energies_of(solver, model, wrong, make_state(start), found, priors).values()))
    assert np.all(np.diff(energies) <= 1e-9 * energies[0])


def test_a_step_is_capped() -> None:
    scene, truth = make_scene(), make_pose(0)
    matches = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False)
    start = start_from(truth, 0)
    pose = solve(TwistGaussNewton(iterations=1, cap_deg=2.0, cap_mm=5.0), scene, start, matches).pose
    assert np.degrees(np.abs(pose.angles - start.angles)).max() <= 2.0 + 1e-9
    assert np.linalg.norm(pose.root[:3, 3] - start.root[:3, 3]) <= 0.005 + 1e-9
    short = TwistGaussNewton(iterations=1, cap_deg=90.0, cap_mm=5.0, damping=1e-12)
    roots = (solve(short, scene, start, matches).pose.root, start.root)
    places = [kinematics.root_position(scene.body, root) for root in roots]
    assert np.linalg.norm(places[0] - places[1]) == pytest.approx(0.005, rel=1e-3)


def test_growing_damping_shortens_the_steps_of_later_turns() -> None:
    scene, truth = make_scene(), make_pose(0)
    matches, start = exact_matches(scene, truth, np.arange(0, 300, 9), directed=False), start_from(truth, 0)
    solver = TwistGaussNewton(iterations=1, damping=0.1, damping_per_turn=10.0, cap_deg=90.0, cap_mm=1000.0)
    moves = []
    for index in range(3):
        turn = Turn(index=index)
        pose = solver.solve(lambda _: matches, make_state(start), ClothedModel(scene=scene), [], Past(), turn).pose
        moves.append(np.linalg.norm(pose.angles - start.angles))
    assert moves[0] > 1.5 * moves[1] > 3 * moves[2]
