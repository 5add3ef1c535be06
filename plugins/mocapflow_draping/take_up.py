"""The cloth fitter of how high the hem hangs: what folds and gathers take up of the strands."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from mocapflow.components import ClothFitter
from mocapflow.data import Cloth, Estimate, Frame, Past, Segmentation, Turn
from mocapflow.geometry.sewing import TAKE_UP
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
    """Moves the take-up of a hanging garment to where the outline fits the images; all else is as estimated.

    In the first frame, in which the person is only being found, there is none; in the second it is looked for anywhere.
    Folds and gathers come and go more slowly than a leg moves, so from there it is a random walk, with a step every
    tenth of a second, in the first turn of a frame. A garment without this parameter is draped as it is.
    """

    name: ClassVar[str] = "take_up"

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the garment draped at the estimated pose with the take-up that fits."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes or TAKE_UP not in garment.parameter_names:
            return cloth
        if turn.index > 0 or not past.moments:
            return cloth
        last, second = past.moments[-1], len(past.moments) == 1
        if not (second or falls_due(last.time, frame.time, EVERY)):
            return cloth
        column = garment.parameter_names.index(TAKE_UP)
        low, high = garment.parameter_bounds[column]
        before = last.cloth.parameters[column]
        if second:
            spread, tried = SPREAD, np.arange(low, high + STEP / 2, STEP)
        else:
            spread = SPREAD * math.sqrt(max(frame.time - last.time, EVERY))
            tried = np.clip(estimate.parameters[column], low + STEP, high - STEP) + STEP * np.array([-1.0, 0.0, 1.0])
        trials = samples.replaced(garment, estimate.parameters, [column], tried[:, None])
        error = outline_error(estimate.pose, cloth, segmentation, model)
        off = np.array([error(vertices) for vertices in model.drapes(estimate.pose, trials, past)])
        best = lowest(tried, off + ((tried - before) / spread) ** 2)
        parameters = samples.replaced(garment, estimate.parameters, [column], np.array([[best]]))[0]
        return model.drape(estimate.pose, parameters, past)


def lowest(places: F64, values: F64) -> float:
    """Return where the parabola through the least of values (N,) at evenly spaced places and its neighbours is lowest.

    At an end the parabola goes on, though not far.
    """
    middle = int(np.clip(values.argmin(), 1, len(values) - 2))
    before, here, after = values[middle - 1 : middle + 2]
    slope, bend = 0.5 * (after - before), before - 2 * here + after
    if bend <= 0:
        return float(places[values.argmin()])
    return float(places[middle] + (places[1] - places[0]) * np.clip(-slope / bend, -FARTHEST, FARTHEST))
