"""One step of the solver: its caps, how it damps, and how priors on the root enter it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple
from unittest.mock import Mock

import numpy as np
import pytest
from mocapflow_priors.smooth_motion import SmoothMotion
from mocapflow_twist import steps
from mocapflow_twist.constraint import line_rows
from mocapflow_twist.covariance import effective_share
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.normal_equations import Equations
from mocapflow_twist.problem import Anchor, Problem
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton
from test_twist_solver import EXACT, FREE, start_from
from twist_fixtures import exact_matches, make_pose, make_scene, make_state

from mocapflow.data import NO_CLOTH, Cloth, Moment, Past, Residual, Turn
from mocapflow.model import ClothedModel, moved

SCENE, TRUTH = make_scene(), make_pose(1)
MODEL = ClothedModel(scene=SCENE)
UNKNOWNS = 6 + len(TRUTH.angles)


def problem_of(solver: TwistGaussNewton, start: Guess, priors: tuple[SmoothMotion, ...] = (), past: Past | None = None):
    """The problem of exact matches of the true pose."""
    data = solver._data(exact_matches(SCENE, TRUTH, np.arange(0, 300, 9), directed=False), MODEL)
    motion = ClothMotion(MODEL, past or Past(), False)
    return Problem(motion, data, priors, Anchor(start, solver._anchor_precision(motion, start)), {})


@pytest.mark.parametrize(("column", "cap"), [(1, 0.1), (4, 0.05), (9, 0.1), (UNKNOWNS - 1, 0.1)])
def test_each_kind_of_move_has_its_cap(column: int, cap: float) -> None:
    """What is too large alone shortens the whole step, and to the cap; cloth has none, the rest of it is small."""
    within = np.append(np.full(UNKNOWNS, 0.02), 9.0)
    increment = within.copy()
    increment[column] = -5.0
    short = steps.capped(increment, UNKNOWNS - 6, 0.1, 0.05)
    first = slice(3 * (column // 3), 3 * (column // 3) + 3) if column < 6 else [column]
    assert np.linalg.norm(short[first]) == pytest.approx(cap)
    np.testing.assert_allclose(short, increment * short[column] / increment[column])
    np.testing.assert_array_equal(steps.capped(within, UNKNOWNS - 6, 0.1, 0.05), within)


def test_a_step_to_the_lowest_point_gains_half_of_what_the_slope_promises() -> None:
    root, slope = np.random.default_rng(0).normal(size=(5, 5)), np.arange(1.0, 6.0)
    equations = Equations(root @ root.T + np.eye(5), slope, 7.0)
    lowest = -np.linalg.solve(equations.hessian, slope)
    assert steps.gain(equations, lowest) == pytest.approx(-slope @ lowest / 2)
    np.testing.assert_allclose(steps.step(equations, np.ones(5), 0.0), lowest)


class Grudging(NamedTuple):
    """A problem whose energy has risen at the first few poses that are tried."""

    problem: Problem
    tried: Mock
    refusals: int

    def __getattr__(self, name: str) -> object:
        return getattr(self.problem, name)

    def energies(self, guess: Guess) -> dict[str, float]:
        self.tried(guess)
        return {"data": np.inf if self.tried.call_count <= self.refusals else 0.0}


@pytest.mark.parametrize(("refusals", "factor"), [(0, 0.1), (1, 1.0), (3, 100.0), (8, 1e8)])
def test_a_worse_step_is_damped_ten_times_more_and_a_better_one_as_much_less(refusals: int, factor: float) -> None:
    solver, start = TwistGaussNewton(), Guess(start_from(TRUTH, 1), NO_CLOTH)
    problem = Grudging(problem_of(solver, start), Mock(), refusals)
    found, damping = solver._descend(problem, start, problem.problem.quadratic(start).total, 1e-3)
    assert damping == pytest.approx(1e-3 * factor)
    assert (found is start) == (refusals == 8)
    assert found is start or found is problem.tried.call_args.args[0]


def test_priors_on_the_root_pull_about_the_root_as_their_energy_says() -> None:
    """Their rows are of increments about the world's origin, the equations of increments about the root."""
    past = Past(moments=tuple(Moment(time=k / 30, pose=make_pose(5 + k, 0.1), cloth=NO_CLOTH) for k in (0, 1)))
    prior = SmoothMotion(weight=3.0, root_sd_mm=40.0)
    solver, guess = TwistGaussNewton(**FREE), Guess(TRUTH, NO_CLOTH)
    problem = problem_of(solver, guess, (prior,), past)
    columns = steps.about_origin(problem.centre(guess), UNKNOWNS).T

    def energy(step: np.ndarray) -> float:
        return problem.energies(Guess(moved(TRUTH, step), NO_CLOTH))["smooth_motion"]

    slope = [(energy(1e-5 * c) - energy(-1e-5 * c)) / 2e-5 for c in columns]
    assert problem.quadratic(guess).prior.gradient == pytest.approx(slope, rel=1e-5, abs=1e-3)
    assert np.abs(slope[3:6]).max() > 1  # of which the lever would make turns


def test_the_anchor_pulls_about_the_root_as_its_energy_says() -> None:
    solver = TwistGaussNewton(root_sd_deg=20.0, root_sd_m=0.05, angle_sd_deg=30.0)
    problem, guess = problem_of(solver, Guess(start_from(TRUTH, 2), NO_CLOTH)), Guess(TRUTH, NO_CLOTH)
    columns = steps.about_origin(problem.centre(guess), UNKNOWNS).T

    def energy(step: np.ndarray) -> float:
        return problem.energies(Guess(moved(TRUTH, step), NO_CLOTH))["anchor"]

    slope = [(energy(1e-5 * c) - energy(-1e-5 * c)) / 2e-5 for c in columns]
    prior = problem.quadratic(guess).prior
    assert prior.gradient == pytest.approx(slope, rel=1e-6)
    sd = np.repeat([np.radians(20), 0.05, np.radians(30)], [3, 3, UNKNOWNS - 6])
    assert prior.hessian == pytest.approx(np.diag(sd**-2))


def test_cloth_is_held_by_its_anchor_alone() -> None:
    """Priors know nothing of it: theirs are the columns (omega, v, angles), more if they like."""
    start = Guess(start_from(TRUTH, 2), Cloth(vertices=np.empty((0, 3)), parameters=np.array([0.3, -0.2])))
    precision = np.append(np.full(UNKNOWNS, 1e-3), [4.0, 9.0])
    empty = problem_of(TwistGaussNewton(), start)
    wide, narrow = Mock(weight=1.0), Mock(weight=1.0)
    jacobian = np.random.default_rng(0).normal(size=(5, UNKNOWNS + 2))
    wide.residual.return_value = Residual(error=np.ones(5), jacobian=jacobian, energy=2.5)
    narrow.residual.return_value = Residual(error=np.ones(5), jacobian=jacobian[:, :UNKNOWNS], energy=2.5)
    held = empty._replace(priors=(narrow,), anchor=Anchor(start, precision), tried={})
    at_rest = held.quadratic(start).prior
    np.testing.assert_array_equal(at_rest.gradient[UNKNOWNS:], 0.0)
    np.testing.assert_array_equal(at_rest.hessian[UNKNOWNS:], np.diag(precision)[UNKNOWNS:])
    swollen = start._replace(cloth=Cloth(vertices=np.empty((0, 3)), parameters=np.array([0.8, -0.2])))
    pulled = held.quadratic(swollen).prior
    assert pulled.gradient[UNKNOWNS:] == pytest.approx([4.0 * 0.5, 0.0])
    assert pulled.energy - at_rest.energy == pytest.approx(0.5 * 4.0 * 0.5**2)
    given, wider = (empty._replace(priors=(prior,), tried={}).quadratic(start).prior for prior in (narrow, wide))
    np.testing.assert_array_equal(given.hessian, wider.hessian)


def test_the_range_of_a_cloth_parameter_moves_the_surface_as_far_whatever_its_unit() -> None:
    ranges = np.array([0.05, 3.0])
    assert steps.levers(2, ranges)[8:] * ranges == pytest.approx(steps.CLOTH_LEVER)


def test_distances_to_rays_count_by_the_weight_of_their_pair() -> None:
    """The chapter's pairs weigh one or nothing; of the three components of each, two are independent."""
    matches = exact_matches(SCENE, TRUTH, np.arange(0, 300, 9), directed=False)
    weight = np.where(np.arange(len(matches.weight)) % 4, np.linspace(0.1, 9, len(matches.weight)), 0.0)
    matches = replace(matches, weight=weight)
    rows = line_rows(matches, SCENE.cameras, 0.003)
    np.testing.assert_allclose(rows.weight, np.repeat(weight, 3) / 0.003**2)
    np.testing.assert_array_equal(effective_share(matches, 0.0), np.ones(len(weight)))
    literal = TwistGaussNewton(residual="line", correlation_px=0.0)._data(matches, MODEL)
    assert literal.measurements == pytest.approx(2 * np.count_nonzero(weight))
    assert literal.body.weight == pytest.approx(np.repeat(weight[weight > 0], 3) / 0.003**2)
    correlated = TwistGaussNewton(residual="line", correlation_px=30.0)._data(matches, MODEL)
    share = effective_share(matches, 30.0)[weight > 0]
    assert share.max() < 1
    assert correlated.measurements == pytest.approx(2 * share.sum())
    assert correlated.body.weight == pytest.approx(np.repeat(weight[weight > 0] * share, 3) / 0.003**2)


def test_balanced_views_pull_alike_and_together_as_hard_as_before() -> None:
    matches = exact_matches(SCENE, TRUTH, np.arange(0, 300, 9), directed=False)
    matches = replace(matches, weight=np.where(matches.camera == 0, 9.0, 1.0))
    plain, balanced = (
        np.bincount(matches.camera[rows.match], rows.weight)
        for rows in (
            TwistGaussNewton(balance_views=balance, correlation_px=0.0)._data(matches, MODEL).body
            for balance in (False, True)
        )
    )
    assert plain.max() > 8 * plain.min()
    assert balanced == pytest.approx(plain.mean())


def test_damping_never_falls_below_that_of_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    step = Mock(side_effect=steps.step)
    monkeypatch.setattr(steps, "step", step)
    matches = exact_matches(SCENE, TRUTH, np.arange(0, 300, 9), directed=False)
    solver = TwistGaussNewton(**{**EXACT, "iterations": 4, "damping": 1e-3}, damping_per_turn=10.0)
    solver.solve(lambda _: matches, make_state(start_from(TRUTH, 1)), MODEL, [], Past(), Turn(index=1))
    used = [call.args[2] for call in step.call_args_list]
    assert len(used) > 2
    assert min(used) == pytest.approx(1e-2)
