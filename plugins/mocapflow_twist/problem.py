"""The energy of a frame for fixed matches (data, priors, anchor) and its quadratic model about the root."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.components import Prior
from mocapflow.data import Pose, Residual
from mocapflow.geometry import twists
from mocapflow.geometry.kinematics import root_position
from mocapflow.guards.outputs import residual_of
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_twist import normal_equations
from mocapflow_twist.constraint import Rows
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.normal_equations import Equations
from mocapflow_twist.steps import about_origin


class Data(NamedTuple):
    """The rows of one set of matches, split by what carries their points."""

    body: Rows
    cloth: Rows  # vertices counted within the garment
    measurements: float  # independent measurements among them


class Anchor(NamedTuple):
    """Where the unknowns are held, weakly, and one over the variance (S,) of each: the system is never singular."""

    guess: Guess
    precision: F64

    def equations(self, guess: Guess, body: Body) -> Equations:
        """Return its energy; the gradient about the root is exact, the Hessian that of small turns."""
        held, pose = self.guess.pose, guess.pose
        turn = twists.log_rotation(pose.root[:3, :3] @ held.root[:3, :3].T)
        shift = root_position(body, pose.root) - root_position(body, held.root)
        cloth = guess.cloth.parameters - self.guess.cloth.parameters
        error = np.concatenate([turn, shift, pose.angles - held.angles, cloth])[: len(self.precision)]
        pull = self.precision * error
        return Equations(np.diag(self.precision), pull, 0.5 * float(pull @ error))


class Quadratic(NamedTuple):
    """The quadratic models about the root: of the data, and of priors with the anchor."""

    data: Equations
    prior: Equations

    @property
    def total(self) -> Equations:
        """The whole quadratic model."""
        d, p = self.data, self.prior
        return Equations(d.hessian + p.hessian, d.gradient + p.gradient, d.energy + p.energy)


class Problem(NamedTuple):
    """All terms of the energy for one set of matches."""

    motion: ClothMotion
    data: Data
    priors: Sequence[Prior]
    anchor: Anchor
    tried: dict[Pose, Sequence[Residual]]  # what the priors say of poses that have been tried

    @property
    def scene(self) -> Scene:
        """The cameras and the person."""
        return self.motion.model.scene

    @property
    def unknowns(self) -> int:
        """Number S of unknowns."""
        return len(self.anchor.precision)

    def centre(self, guess: Guess) -> F64:
        """Return the position of the root joint (3,) m, about which increments are solved."""
        return root_position(self.scene.body, guess.pose.root)

    def energies(self, guess: Guess) -> Mapping[str, float]:
        """Return each term of the energy at a guess."""
        body = self.scene.body
        data = normal_equations.body_energy(self.data.body, body, guess.pose)
        worn = self.data.cloth
        if len(worn.vertex):
            error, _ = normal_equations.point_errors(worn, guess.cloth.vertices.take(worn.vertex, axis=0))
            data += 0.5 * float(worn.weight @ error**2)
        terms = {"data": data, "anchor": self.anchor.equations(guess, body).energy}
        for prior, residual in zip(self.priors, self._residuals(guess), strict=True):
            terms[prior.name] = terms.get(prior.name, 0.0) + prior.weight * residual.energy
        return terms

    def quadratic(self, guess: Guess) -> Quadratic:
        """Return the quadratic models at a guess."""
        return Quadratic(self._data_equations(guess), self._prior_equations(guess))

    def _data_equations(self, guess: Guess) -> Equations:
        skin = normal_equations.body_equations(self.data.body, self.scene.body, guess.pose)
        hessian, gradient = np.zeros((self.unknowns, self.unknowns)), np.zeros(self.unknowns)
        moved = len(skin.gradient)
        hessian[:moved, :moved], gradient[:moved] = skin.hessian, skin.gradient
        if not len(self.data.cloth.vertex):
            return Equations(hessian, gradient, skin.energy)
        worn = normal_equations.dense_equations(self.data.cloth, guess.cloth.vertices, self.motion.velocity(guess))
        move = about_origin(self.centre(guess), self.unknowns)
        hessian += move.T @ worn.hessian @ move
        return Equations(hessian, gradient + move.T @ worn.gradient, skin.energy + worn.energy)

    def _prior_equations(self, guess: Guess) -> Equations:
        hessian, gradient, energy = self.anchor.equations(guess, self.scene.body)
        residuals = self._residuals(guess)
        rows = np.zeros((sum(len(residual.error) for residual in residuals), self.unknowns))
        error, weight = np.empty(len(rows)), np.empty(len(rows))
        first = 0
        for prior, residual in zip(self.priors, residuals, strict=True):
            here = slice(first, first := first + len(residual.error))
            columns = min(residual.jacobian.shape[1], self.unknowns)
            rows[here, :columns] = residual.jacobian[:, :columns]
            error[here], weight[here] = residual.error, prior.weight
            energy += prior.weight * residual.energy
        rows[:, :3] += rows[:, 3:6] @ twists.hat(self.centre(guess))  # about the root
        pulling = (weight[:, None] * rows).T
        return Equations(hessian + pulling @ rows, gradient + pulling @ error, energy)

    def _residuals(self, guess: Guess) -> Sequence[Residual]:
        if guess.pose not in self.tried:
            self.tried[guess.pose] = [residual_of(p, guess.pose, self.motion.past, self.scene) for p in self.priors]
        return self.tried[guess.pose]
