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

SPREAD = 0.05  # standard deviation of the take-up's change in a second, share of a strand's length
EVERY = 0.1  # s between two steps of it; where frames are farther apart, each takes one
STEP = 0.01  # between the three take-ups that are compared, share of a strand's length
FARTHEST = 2.0  # steps from the middle of three values that their parabola is trusted


class TakeUp(ClothFitter):
    """Moves the take-up of a hanging garment to where the outline fits the images; all else is as estimated.

    Folds and gathers come and go more slowly than a leg moves, so it is a random walk that begins at none in the first
    frame and takes a step every tenth of a second, in the first turn of a frame. A garment without this parameter is
    draped as it is.
    """

    name: ClassVar[str] = "take_up"

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the garment draped at the estimated pose with the take-up that fits."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes or TAKE_UP not in garment.parameter_names:
            return cloth
        if turn.index > 0 or not past.moments:  # in the first frame the person is only being found
            return cloth
        last = past.moments[-1]
        if not falls_due(last.time, frame.time, EVERY):
            return cloth
        column = garment.parameter_names.index(TAKE_UP)
        low, high = garment.parameter_bounds[column]
        before = last.cloth.parameters[column]
        spread = SPREAD * math.sqrt(max(frame.time - last.time, EVERY))
        middle = np.clip(estimate.parameters[column], low + STEP, high - STEP)
        tried = middle + STEP * np.array([-1.0, 0.0, 1.0])
        trials = samples.replaced(garment, estimate.parameters, [column], tried[:, None])
        error = outline_error(estimate.pose, cloth, segmentation, model)
        off = np.array([error(vertices) for vertices in model.drapes(estimate.pose, trials, past)])
        best = lowest(tried, off + ((tried - before) / spread) ** 2)
        parameters = samples.replaced(garment, estimate.parameters, [column], np.array([[best]]))[0]
        return model.drape(estimate.pose, parameters, past)


def lowest(places: F64, values: F64) -> float:
    """Return where the parabola through values (3,) at evenly spaced places is lowest, not far beyond them."""
    slope, bend = 0.5 * (values[2] - values[0]), values[0] - 2 * values[1] + values[2]
    if bend <= 0:
        return float(places[values.argmin()])
    return float(places[1] + (places[1] - places[0]) * np.clip(-slope / bend, -FARTHEST, FARTHEST))
