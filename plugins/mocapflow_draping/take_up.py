"""The cloth fitter of what a garment keeps from frame to frame: how far it stands off, and how high its hem hangs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np

from mocapflow.components import ClothFitter
from mocapflow.data import REMEMBERED, Cloth, Estimate, Frame, Past, Pose, Segmentation, Turn
from mocapflow.geometry.sewing import TAKE_UP, THICKNESS
from mocapflow.model import ClothedModel
from mocapflow.periodic import falls_due
from mocapflow.records import F64
from mocapflow_draping import samples
from mocapflow_draping.outline import outline_error

SPREAD = 0.05  # standard deviation of the take-up, and of its change in a second, share of a strand's length
EVERY = 0.1  # s between two steps of it; where frames are farther apart, each takes one
STEP = 0.01  # between the take-ups that are compared, share of a strand's length
FARTHEST = 2.0  # steps from the middle of three values that their parabola is trusted


class TakeUp(ClothFitter):
    """Moves take-up and thickness of a garment to where the outline fits the images; all else is as estimated.

    In the first frame, in which the person is only being found, there is none of either. In the second the take-up is
    looked for anywhere. Folds and gathers come and go more slowly than a leg moves, so from there it is a random walk,
    with a step every tenth of a second, in the first turn of a frame. The thickness is the mean of those that fit the
    second and the third frame, and stays. A garment without one of these parameters is draped as it is.
    """

    name: ClassVar[str] = "take_up"

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the garment draped at the estimated pose with the take-up and the thickness that fit."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes or turn.index > 0 or not past.moments:
            return cloth
        lived = len(past.moments)
        due = lived == 1 or falls_due(past.moments[-1].time, frame.time, EVERY)
        take_ups = garment.columns(TAKE_UP) if due else []
        thicknesses = garment.columns(THICKNESS) if lived < REMEMBERED else []
        if not (take_ups or thicknesses):
            return cloth
        trials = Trials(estimate.pose, model, past, outline_error(estimate.pose, cloth, segmentation, model))
        for column in take_ups:
            cloth = taken_up(cloth, column, trials, frame.time)
        for column in thicknesses:
            cloth = thickened(cloth, column, trials)
        return cloth


class Trials(NamedTuple):
    """Drapes at one pose that differ in one parameter."""

    pose: Pose
    model: ClothedModel
    past: Past
    error: Callable[[F64], float]  # of the outline of cloth (W, 3) m

    def bounds(self, column: int) -> F64:
        """Return the bounds (2,) of a parameter."""
        garment = self.model.scene.garment
        assert garment is not None
        bounds: F64 = garment.parameter_bounds[column]
        return bounds

    def errors(self, cloth: Cloth, column: int, values: F64) -> F64:
        """Return the error of the outline (B,) for each value of a parameter."""
        changed = self._changed(cloth, column, values)
        return np.array([self.error(vertices) for vertices in self.model.drapes(self.pose, changed, self.past)])

    def draped(self, cloth: Cloth, column: int, value: float) -> Cloth:
        """Return the garment with another value of a parameter."""
        return self.model.drape(self.pose, self._changed(cloth, column, np.array([value]))[0], self.past)

    def _changed(self, cloth: Cloth, column: int, values: F64) -> F64:
        assert self.model.scene.garment is not None
        return samples.replaced(self.model.scene.garment, cloth.parameters, [column], values[:, None])


def taken_up(cloth: Cloth, column: int, trials: Trials, time: float) -> Cloth:
    """Return the garment taken up as the outline says, not far from what it was the frame before."""
    low, high = trials.bounds(column)
    last = trials.past.moments[-1]
    if len(trials.past.moments) == 1:
        spread, tried = SPREAD, np.arange(low, high + STEP / 2, STEP)
    else:
        spread = SPREAD * math.sqrt(max(time - last.time, EVERY))
        tried = np.clip(cloth.parameters[column], low + STEP, high - STEP) + STEP * np.array([-1.0, 0.0, 1.0])
    moved = (tried - last.cloth.parameters[column]) / spread
    return trials.draped(cloth, column, lowest(tried, trials.errors(cloth, column, tried) + moved**2))


def thickened(cloth: Cloth, column: int, trials: Trials) -> Cloth:
    """Return the garment as thick as the outlines of the frames from the second to this one say in the mean."""
    low, high = trials.bounds(column)
    tried, frames = np.linspace(low, high, samples.THICKNESSES), len(trials.past.moments)
    found = float(np.clip(lowest(tried, trials.errors(cloth, column, tried)), low, high))
    before = trials.past.moments[-1].cloth.parameters[column] if frames > 1 else found
    return trials.draped(cloth, column, before + (found - before) / frames)


def lowest(places: F64, values: F64) -> float:
    """Return where the parabola through the least of values (N,) at evenly spaced places and its neighbours is lowest.

    At an end the parabola goes on, though not far. Fewer than three values, as of narrow bounds, have none.
    """
    if len(values) < 3:
        return float(places[values.argmin()])
    middle = int(np.clip(values.argmin(), 1, len(values) - 2))
    before, here, after = values[middle - 1 : middle + 2]
    slope, bend = 0.5 * (after - before), before - 2 * here + after
    if bend <= 0:
        return float(places[values.argmin()])
    return float(places[middle] + (places[1] - places[0]) * np.clip(-slope / bend, -FARTHEST, FARTHEST))
