"""The error of a clothed outline as a function of the cloth, or of a leg and the cloth: what `optimisers` minimise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from minimisers import Rule
from mocapflow_draping import samples
from mocapflow_draping.sampled_forces import SampledForces
from mocapflow_draping.take_up import STEP
from mocapflow_twist.constraint import image_rows
from mocapflow_twist.gauss_newton import GaussNewton, Task
from mocapflow_twist.normal_equations import Equations, body_equations, dense_equations

from mocapflow.data import Cloth, FrameState, Past, PoseBatch
from mocapflow.geometry.misfit import unclipped
from mocapflow.geometry.sewing import TAKE_UP, THICKNESS
from mocapflow.model import ClothedModel
from mocapflow.records import F64

ANGLE_SD = np.radians(10.0)  # of a start
CLOTH_SD = 0.15  # likewise, share of a parameter's range
DIFFERENCE = 0.1  # of these, a step of the differences: 1° and 1.5 %
PAST = Past()


class Outline:
    """The error of the outline in one frame for unknowns in standard deviations of a start off the track."""

    def __init__(self, state: FrameState, model: ClothedModel, angles: Sequence[str]) -> None:
        body, garment, pose = model.scene.body, model.scene.garment, state.estimate.pose
        assert garment is not None
        names = [*body.screw_names, *garment.parameter_names]
        cloth = [name for name in garment.parameter_names if name != THICKNESS]
        self.columns = np.array([names.index(name) for name in (*angles, *cloth)])
        self.bends = len(angles)
        self.unknowns = len(self.columns)
        self.tracked = np.concatenate([pose.angles, state.cloth.parameters])
        ranges = np.concatenate([np.zeros(len(pose.angles)), np.ptp(garment.parameter_bounds, axis=1)])[self.columns]
        self.spread = np.where(ranges == 0, ANGLE_SD, CLOTH_SD * ranges)
        free = np.full((len(pose.angles), 2), [-np.inf, np.inf])  # of angles: the images alone say how a leg bends
        bounds = np.concatenate([free, garment.parameter_bounds])[self.columns]
        self.low, self.high = ((bounds - self.tracked[self.columns, None]) / self.spread[:, None]).T
        surface, seen = model.surface(pose, state.cloth), unclipped(state.segmentation)
        self.task = Task(GaussNewton(), seen, state.estimate, model, garment, PAST, surface)
        self.coarse = list(self._coarse())

    def within(self, at: F64) -> F64:
        """Return the nearest place at which no parameter is beyond its bounds."""
        return np.clip(at, self.low, self.high)

    def error(self, at: F64) -> float:
        """Return the error at a place (N,)."""
        task, cloth = self._draped(at)
        return task.energy(cloth)

    def drapes(self, rule: Rule) -> int:
        """Return how many drapes the equations take."""
        return self.unknowns + 1 if rule == "fd" else 1

    def equations(self, at: F64, rule: Rule) -> Equations:
        """Return the quadratic model of the error about a place."""
        (task, cloth), model = self._draped(at), self.task.model
        pose, first = task.estimate.pose, len(model.scene.body.vertices)
        rows = image_rows(task.matches(task.surface), model.scene.cameras)
        worn = rows.part(rows.vertex >= first, rows.weight, first)
        bare = rows.part(rows.vertex < first, rows.weight)
        velocity = self._differences(at) if rule == "fd" else self._rates(task, cloth)
        hessian, gradient, energy = dense_equations(worn, cloth.vertices, velocity)
        skin = body_equations(bare, model.scene.body, pose)
        bent, calm = np.s_[: len(skin.gradient)], np.arange(len(skin.gradient), len(gradient))
        hessian[bent, bent] += skin.hessian
        gradient[bent] += skin.gradient
        off = cloth.parameters - model.scene.neutral_parameters
        hessian[calm, calm] += task.precision
        gradient[calm] += task.precision * off
        energy += skin.energy + 0.5 * float(task.precision @ off**2)
        chosen = 6 + self.columns
        scaled = hessian[np.ix_(chosen, chosen)] * np.outer(self.spread, self.spread)
        return Equations(scaled, gradient[chosen] * self.spread, energy)

    def _values(self, at: F64) -> tuple[F64, F64]:
        """Return angles (B, D) and parameters (B, Q) at places (B, N)."""
        values = np.repeat(self.tracked[None], len(at), axis=0)
        values[:, self.columns] += self.spread * self.within(at)
        split = len(self.task.estimate.pose.angles)
        return values[:, :split], values[:, split:]

    def _draped(self, at: F64) -> tuple[Task, Cloth]:
        (angles,), (parameters,) = self._values(at[None])
        pose, model = replace(self.task.estimate.pose, angles=angles), self.task.model
        cloth = model.drape(pose, parameters, PAST)
        estimate = replace(self.task.estimate, pose=pose)
        return self.task._replace(estimate=estimate, surface=model.surface(pose, cloth)), cloth

    def _differences(self, at: F64) -> F64:
        """Return the velocities (W, 3, 6 + D + Q) of the cloth along the unknowns, by one batch of drapes."""
        model = self.task.model
        assert model.draper is not None
        step = DIFFERENCE * np.where(at > 0, -1.0, 1.0)  # towards the track, which is within the bounds
        angles, parameters = self._values(np.concatenate([at + np.diag(step), at[None]]))
        root = np.repeat(self.task.estimate.pose.root[None], len(angles), axis=0)
        draped = model.draper.drape(PoseBatch(root=root, angles=angles), parameters, PAST, model.scene)
        velocity = np.zeros((*draped.shape[1:], 6 + len(self.tracked)))
        velocity[..., 6 + self.columns] = np.moveaxis(draped[:-1] - draped[-1], 0, -1) / (step * self.spread)
        return velocity

    def _rates(self, task: Task, cloth: Cloth) -> F64:
        """Return the same by the draper's own rates."""
        every = np.arange(len(cloth.vertices), dtype=np.int32)
        return task.model.velocity(task.estimate.pose, cloth, every, PAST)

    def _coarse(self) -> Iterator[tuple[list[int], F64]]:
        """Yield the columns of each angle with nothing, then take-up and forces with what their fitters try first."""
        yield from (([column], np.empty((0, 1))) for column in range(self.bends))
        garment, fitter, angles = self.task.garment, SampledForces(), len(self.task.estimate.pose.angles)
        take_up = garment.parameter_names.index(TAKE_UP)
        tried = [([take_up], np.arange(*garment.parameter_bounds[take_up], STEP)[:, None])]
        amounts = np.radians(fitter.amounts_deg)
        for columns in samples.forces(garment):
            tried.append((columns, samples.in_all_directions(len(columns), fitter.directions, amounts)))
        for columns, values in tried:
            place = [list(self.columns).index(angles + column) for column in columns]
            yield place, (values - self.tracked[self.columns[place]]) / self.spread[place]
