"""How the cloth follows an increment while the pose is solved."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mocapflow.data import Cloth, Past
from mocapflow.model import ClothedModel, moved
from mocapflow.records import F64, I32
from mocapflow_twist.normal_equations import Equations
from mocapflow_twist.problem import Guess


@dataclass
class ClothMotion:
    """Moves pose and cloth together; lives as long as one call of the solver.

    Measuring the motion of the cloth takes many drapes, so it is done only when a match needs it and, with
    `measure_once`, for all vertices together.
    """

    model: ClothedModel
    past: Past
    unknowns: bool  # the cloth parameters are solved for
    redrape: bool  # drape at every new pose; else move the cloth linearly
    measure_once: bool
    _measured: list[F64] = field(default_factory=list)

    def velocity(self, guess: Guess, vertices: I32) -> F64 | None:
        """Return velocities (R, 3, S) of cloth vertices (R,) for increments about the origin; None without any."""
        if not len(vertices):
            return None
        if self.measure_once:
            return self._all(guess)[vertices]
        return self._columns(self.model.velocity(guess.pose, guess.cloth, vertices, self.past), guess)

    def moved(self, guess: Guess, increment: F64) -> Guess:
        """Return the guess after an increment (S,) about the origin."""
        pose = moved(guess.pose, increment[: 6 + len(guess.pose.angles)])
        if not self.model.clothed:
            return Guess(pose, guess.cloth)
        parameters = guess.cloth.parameters
        if self.unknowns:
            low, high = self._bounds.T
            parameters = np.clip(parameters + increment[6 + len(pose.angles) :], low, high)
        if self.redrape:
            return Guess(pose, self.model.drape(pose, parameters, self.past))
        taken = np.concatenate([increment[: 6 + len(pose.angles)], parameters - guess.cloth.parameters])
        velocity = self._all(guess)
        vertices = guess.cloth.vertices + velocity @ taken[: velocity.shape[2]]
        return Guess(pose, Cloth(vertices=vertices, parameters=parameters))

    def within_bounds(self, equations: Equations, guess: Guess) -> Equations:
        """Return the equations with cloth parameters held that stand at a bound and would leave it."""
        if not (self.unknowns and self.model.clothed):
            return equations
        low, high = self._bounds.T
        first = 6 + len(guess.pose.angles)
        downhill, parameters = -equations.gradient[first:], guess.cloth.parameters
        held = first + np.flatnonzero(((parameters <= low) & (downhill < 0)) | ((parameters >= high) & (downhill > 0)))
        hessian, gradient = equations.hessian.copy(), equations.gradient.copy()
        gradient[held] = 0.0
        diagonal = hessian[held, held]
        hessian[held], hessian[:, held] = 0.0, 0.0
        hessian[held, held] = diagonal
        return Equations(hessian, gradient, equations.energy)

    @property
    def _bounds(self) -> F64:
        assert self.model.scene.garment is not None
        return self.model.scene.garment.parameter_bounds

    def _all(self, guess: Guess) -> F64:
        if not self._measured:
            every = np.arange(len(guess.cloth.vertices), dtype=np.int32)
            velocity = self.model.velocity(guess.pose, guess.cloth, every, self.past)
            self._measured.append(self._columns(velocity, guess))
        return self._measured[0]

    def _columns(self, velocity: F64, guess: Guess) -> F64:
        return velocity if self.unknowns else velocity[..., : 6 + len(guess.pose.angles)]
