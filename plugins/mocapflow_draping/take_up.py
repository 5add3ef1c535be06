"""The cloth fitter of what a garment keeps from frame to frame: how far it stands off, and how high its hem hangs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import PositiveFloat

from mocapflow.data import REMEMBERED, Cloth, Estimate, Frame, Past, Pose, Segmentation, Turn
from mocapflow.geometry.sewing import TAKE_UP, THICKNESS
from mocapflow.model import ClothedModel
from mocapflow.periodic import falls_due
from mocapflow.records import F64
from mocapflow_draping import samples
from mocapflow_draping.outline import OutlineFitter

FARTHEST = 2.0  # steps from the middle of three values that their parabola is trusted


class TakeUp(OutlineFitter):
    """Moves thickness and take-up of a garment to where the outline fits the images; all else is as estimated.

    The thickness does not change: it is the mean of those that fit the first frames but the very first, in which the
    person is only being found. Folds and gathers come and go more slowly than a leg moves, so what they take up is a
    random walk that begins at none and takes a step every `every_s`, in the first turn of a frame. A garment without
    one of these parameters is draped as it is.
    """

    name: ClassVar[str] = "take_up"
    take_up_sd: PositiveFloat = 0.05  # standard deviation of its change in a second, share of a strand's length
    every_s: PositiveFloat = 0.1  # between two steps; where frames are farther apart, each takes one
    step: PositiveFloat = 0.01  # to either side, of the three drapes that are compared

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the garment draped at the estimated pose with the thickness and the take-up that fit."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes or turn.index > 0 or not past.moments:
            return cloth
        last, names = past.moments[-1], garment.parameter_names
        early = THICKNESS in names and len(past.moments) < REMEMBERED
        due = TAKE_UP in names and falls_due(last.time, frame.time, self.every_s)
        if not (early or due):
            return cloth
        trials = Trials(estimate.pose, model, past, self.outline_error(estimate.pose, cloth, segmentation, model))
        if early:
            cloth = _thickened(cloth, trials, len(past.moments))
        return self._taken_up(cloth, trials, frame.time) if due else cloth

    def _taken_up(self, cloth: Cloth, trials: Trials, time: float) -> Cloth:
        column, (low, high) = trials.parameter(TAKE_UP)
        last = trials.past.moments[-1]
        spread = self.take_up_sd * math.sqrt(max(time - last.time, self.every_s))
        middle = np.clip(cloth.parameters[column], low + self.step, high - self.step)
        tried = middle + self.step * np.array([-1.0, 0.0, 1.0])
        walked = (tried - last.cloth.parameters[column]) / spread
        return trials.draped(cloth, column, lowest(tried, trials.errors(cloth, column, tried) + walked**2))


class Trials(NamedTuple):
    """Drapes at one pose that differ in one parameter."""

    pose: Pose
    model: ClothedModel
    past: Past
    error: Callable[[F64], float]  # of the outline of cloth (W, 3)

    def parameter(self, name: str) -> tuple[int, F64]:
        """Return the column of a parameter, and its bounds (2,)."""
        assert self.model.scene.garment is not None
        column = self.model.scene.garment.parameter_names.index(name)
        return column, self.model.scene.garment.parameter_bounds[column]

    def errors(self, cloth: Cloth, column: int, values: F64) -> F64:
        """Return the error of the outline (B,) for each value of a parameter."""
        return np.array(
            [self.error(v) for v in self.model.drapes(self.pose, self._changed(cloth, column, values), self.past)]
        )

    def draped(self, cloth: Cloth, column: int, value: float) -> Cloth:
        """Return the garment with another value of a parameter."""
        return self.model.drape(self.pose, self._changed(cloth, column, np.array([value]))[0], self.past)

    def _changed(self, cloth: Cloth, column: int, values: F64) -> F64:
        assert self.model.scene.garment is not None
        return samples.replaced(self.model.scene.garment, cloth.parameters, [column], values[:, None])


def _thickened(cloth: Cloth, trials: Trials, frames: int) -> Cloth:
    """Return the garment as thick as the outlines of so many frames, this one the last, say in the mean."""
    column, (low, high) = trials.parameter(THICKNESS)
    tried = np.linspace(low, high, samples.THICKNESSES)
    off = trials.errors(cloth, column, tried)
    near = int(np.clip(off.argmin(), 1, len(tried) - 2)) + np.arange(-1, 2)
    found = float(np.clip(lowest(tried[near], off[near]), low, high))
    before = trials.past.moments[-1].cloth.parameters[column] if frames > 1 else found
    return trials.draped(cloth, column, before + (found - before) / frames)


def lowest(places: F64, values: F64) -> float:
    """Return where the parabola through values (3,) at evenly spaced places is lowest, not far beyond them."""
    slope, bend = 0.5 * (values[2] - values[0]), values[0] - 2 * values[1] + values[2]
    if bend <= 0:
        return float(places[values.argmin()])
    return float(places[1] + (places[1] - places[0]) * np.clip(-slope / bend, -FARTHEST, FARTHEST))
