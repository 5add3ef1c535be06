"""Six ways to look for the least of a function: what `optimisers` compares. Each goes on until the budget is spent.

Unknowns are scaled: one is the standard deviation of the starts, for all alike. So a first step is as wide for
everybody.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from mocapflow_draping.take_up import lowest
from mocapflow_twist import steps
from mocapflow_twist.gauss_newton import FIRST_DAMPING, TRIALS
from mocapflow_twist.normal_equations import Equations

from mocapflow.records import F64

Rule = Literal["fd", "strand"]  # how the cloth's velocity is found: by differences, or by rates of the draper
LEAST_STEP = 1e-3  # of the searches that halve their steps


class Problem(Protocol):
    """What is to be minimised."""

    unknowns: int
    coarse: Sequence[tuple[list[int], F64]]  # columns of a force, and the values (B, columns) to try first

    def within(self, at: F64) -> F64:
        """Return the nearest place (N,) that is within the bounds."""

    def error(self, at: F64) -> float:
        """Return the error at a place, or at the nearest within the bounds; takes one drape."""

    def equations(self, at: F64, rule: Rule) -> Equations:
        """Return the quadratic model of the error about a place."""

    def drapes(self, rule: Rule) -> int:
        """Return how many drapes the equations take."""


class Spent(Exception):
    """No evaluation is left."""


@dataclass
class Budget:
    """A problem whose drapes are counted; `least` holds the smallest error known after each of them."""

    problem: Problem
    drapes: int
    least: list[float] = field(default_factory=list)

    def error(self, at: F64) -> float:
        """Return the error of the problem; raises `Spent` where no drape is left."""
        self._spend(1)
        found = self.problem.error(at)
        self.least[-1] = min(self.least[-1], found)
        return found

    def equations(self, at: F64, rule: Rule) -> Equations:
        """Return the equations of the problem, likewise."""
        self._spend(self.problem.drapes(rule))
        return self.problem.equations(at, rule)

    def _spend(self, drapes: int) -> None:
        if len(self.least) + drapes > self.drapes:
            raise Spent
        self.least += drapes * [self.least[-1] if self.least else np.inf]


Minimiser = Callable[[Budget, F64, int], None]  # from a start (N,), with a seed


def sampling(budget: Budget, start: F64, seed: int) -> None:
    """One force after the other, all its directions first, then its neighbours, as `sampled_forces` and `take_up`."""
    best, least = start, budget.error(start)

    def kept(trials: F64) -> None:
        nonlocal best, least
        errors = [budget.error(trial) for trial in trials]
        if min(errors) < least:
            best, least = trials[int(np.argmin(errors))], min(errors)

    for columns, values in budget.problem.coarse:
        if len(values):
            trials = np.repeat(best[None], len(values), axis=0)
            trials[:, columns] = values
            kept(trials)
    step = 0.5
    while step > LEAST_STEP:
        for columns, _ in budget.problem.coarse:
            moves = step * np.eye(len(best))[columns]
            kept(best + np.concatenate([moves, -moves]))
        step /= 2


def coordinate_descent(budget: Budget, start: F64, seed: int) -> None:
    """One unknown after the other, each to the lowest point of a parabola through three values."""
    best, least, step = start, budget.error(start), 1.0
    while step > LEAST_STEP:
        before = best
        for axis in np.eye(len(start)):
            places = step * np.array([-1.0, 0.0, 1.0])
            values = np.array([budget.error(best - step * axis), least, budget.error(best + step * axis)])
            bottom = lowest(places, values)
            places, values = np.append(places, bottom), np.append(values, budget.error(best + bottom * axis))
            best, least = best + places[values.argmin()] * axis, float(values.min())
        if np.abs(best - before).max() < step:
            step /= 2


def gauss_newton(budget: Budget, start: F64, rule: Rule) -> None:
    """Damped steps of the normal equations, as the cloth fitter of this name takes them."""
    best, least, damping = start, budget.error(start), FIRST_DAMPING
    while True:
        equations = budget.equations(best, rule)
        for _ in range(TRIALS):
            trial = budget.problem.within(best + steps.step(equations, np.ones(len(best)), damping))
            reached = budget.error(trial)
            if reached < least:
                best, least, damping = trial, reached, steps.LOWERED * damping
                break
            damping *= steps.RAISED
        else:
            return


def nelder_mead(budget: Budget, start: F64, seed: int) -> None:
    """A simplex of one step along each unknown, by scipy."""
    from scipy.optimize import minimize

    simplex = start + np.concatenate([np.zeros((1, len(start))), np.eye(len(start))])
    minimize(budget.error, start, method="Nelder-Mead", options={"initial_simplex": simplex})


def cma_es(budget: Budget, start: F64, seed: int) -> None:
    """Samples of a normal distribution that takes the shape of the valley, by the package cma."""
    import cma

    budget.error(start)
    search = cma.CMAEvolutionStrategy(start, 1.0, {"seed": seed + 1, "verbose": -9})
    while True:
        trials = search.ask()
        search.tell(trials, [budget.error(trial) for trial in trials])


MINIMISERS: dict[str, Minimiser] = {
    "alternating sampling": sampling,
    "coordinate descent": coordinate_descent,
    "Gauss-Newton, differences": lambda budget, start, _: gauss_newton(budget, start, "fd"),
    "Gauss-Newton, strand rule": lambda budget, start, _: gauss_newton(budget, start, "strand"),
    "Nelder-Mead": nelder_mead,
    "CMA-ES": cma_es,
}
