"""The minimisers that `benchmarks/optimisers.py` compares, on a valley whose bottom is known."""

import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mocapflow_twist.normal_equations import Equations

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

import minimisers  # noqa: E402

BOTTOM = np.array([0.7, -0.4, 0.2])
BEND = np.array([[3.0, 0.5, 0.0], [0.5, 1.0, 0.3], [0.0, 0.3, 2.0]])


class Valley:
    unknowns = 3
    coarse = tuple(([column], np.linspace(-2.0, 2.0, 5)[:, None]) for column in range(3))

    def within(self, at):
        return np.clip(at, -2.0, 2.0)

    def error(self, at):
        return 0.5 * float((at - BOTTOM) @ BEND @ (at - BOTTOM))

    def equations(self, at, rule):
        return Equations(BEND, BEND @ (at - BOTTOM), self.error(at))

    def drapes(self, rule):
        return 4 if rule == "fd" else 1


@pytest.mark.parametrize("name", minimisers.MINIMISERS)
def test_a_minimiser_finds_the_bottom_and_spends_no_more_than_it_has(name):
    """T-FUT."""
    budget = minimisers.Budget(Valley(), 200)
    with suppress(minimisers.Spent):
        minimisers.MINIMISERS[name](budget, np.array([-0.6, 1.1, -0.9]), 0)
    assert budget.least[-1] < 1e-3 * budget.least[0]
    assert len(budget.least) <= 200
    assert np.all(np.diff(budget.least) <= 0)


@pytest.mark.parametrize(("rule", "drapes"), [("fd", 4), ("strand", 1)])
def test_equations_are_counted_as_the_drapes_that_they_take(rule, drapes):
    budget = minimisers.Budget(Valley(), 5)
    budget.error(BOTTOM + 1.0)
    budget.equations(BOTTOM, rule)
    assert len(budget.least) == 1 + drapes
    with pytest.raises(minimisers.Spent):
        for _ in range(5):
            budget.equations(BOTTOM, rule)
