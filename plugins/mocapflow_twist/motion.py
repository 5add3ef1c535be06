"""How the cloth follows an increment while the pose is solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mocapflow.data import Cloth, Past, Pose
from mocapflow.geometry.sewing import NO_FORCES
from mocapflow.model import ClothedModel, moved
from mocapflow.records import F64
from mocapflow_twist.normal_equations import Equations
from mocapflow_twist.steps import at_bound


class Guess(NamedTuple):
    """A pose with the cloth on it."""

    pose: Pose
    cloth: Cloth


@dataclass
class ClothMotion:
    """Moves pose and cloth together; lives as long as one call of the solver.

    The cloth is draped anew at every pose. Measuring how it moves takes many drapes, so that is done once, only when a
    match needs it, at the guess of that moment.
    """

    model: ClothedModel
    past: Past
    cloth_unknowns: bool  # the cloth parameters are solved for
    _velocity: F64 | None = None

    def velocity(self, guess: Guess) -> F64:
        """Return velocities (W, 3, S) of the cloth for increments about the origin, measured at the first guess."""
        if self._velocity is None:
            every = np.arange(len(guess.cloth.vertices), dtype=np.int32)
            velocity = self.model.velocity(guess.pose, guess.cloth, every, self.past)
            columns = velocity.shape[2] if self.cloth_unknowns else 6 + len(guess.pose.angles)
            self._velocity = np.ascontiguousarray(velocity[..., :columns])
        return self._velocity

    def moved(self, guess: Guess, increment: F64) -> Guess:
        """Return the guess after an increment (S,) about the origin."""
        pose = moved(guess.pose, increment[: 6 + len(guess.pose.angles)])
        if not self.model.clothed:
            return Guess(pose, guess.cloth)
        parameters = guess.cloth.parameters
        if self.cloth_unknowns:
            low, high = self.bounds.T
            parameters = np.clip(parameters + increment[6 + len(pose.angles) :], low, high)
        return Guess(pose, self.model.drape(pose, parameters, self.past))

    def within_bounds(self, equations: Equations, guess: Guess) -> Equations:
        """Return the equations with the slow cloth parameters held, and those at a bound that would leave it."""
        if not len(self.bounds):
            return equations
        low, high = self.bounds.T
        first = 6 + len(guess.pose.angles)
        downhill, parameters = -equations.gradient[first:], guess.cloth.parameters
        still = at_bound(parameters, downhill, low, high)
        still[self._slow] = True
        held = first + np.flatnonzero(still)
        hessian, gradient = equations.hessian.copy(), equations.gradient.copy()
        gradient[held] = 0.0
        diagonal = hessian[held, held]
        hessian[held], hessian[:, held] = 0.0, 0.0
        hessian[held, held] = diagonal
        return Equations(hessian, gradient, equations.energy)

    @property
    def _slow(self) -> list[int]:
        """Which cloth parameters follow the recording, not the frame: a cloth fitter moves them."""
        assert self.model.scene.garment is not None
        return self.model.scene.garment.columns(*NO_FORCES)

    @property
    def bounds(self) -> F64:
        """The bounds (Q, 2) of the cloth parameters that are solved for: of all or of none."""
        garment = self.model.scene.garment
        if not self.cloth_unknowns or self.model.draper is None or garment is None:
            return np.empty((0, 2))
        return garment.parameter_bounds
