"""The chapter's cloth fitter: try forces, keep the one under which the outline fits the images best."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow.assets import GarmentMesh
from mocapflow.components import ClothFitter
from mocapflow.data import Cloth, Estimate, Frame, Past, Segmentation, Turn
from mocapflow.geometry.misfit import dressed, misfit
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow_draping import samples

FIRST_FRAMES = 2  # as many as a Past remembers

Positive = Annotated[float, Field(gt=0)]


class SampledForces(ClothFitter):
    """Tries directions and amounts of every force and refines the best; later frames try only around the last best.

    The thickness of a cloth does not change: it is searched for in the first frames and kept.

    Source: Rosenhahn 2008, section 12.4
    """

    name: ClassVar[str] = "sampled_forces"
    directions: Annotated[int, Field(ge=2)] = 8  # tried of a force that has two components
    amounts_deg: tuple[Positive, ...] = (5.0, 10.0, 20.0)  # tried in each direction
    step_deg: Positive = 2.5  # of the refinement; half as much each round
    step_mm: Positive = 1.0  # of the thickness, likewise
    rounds: Annotated[int, Field(ge=0)] = 2  # of the refinement
    least_gain: Annotated[float, Field(ge=0, lt=1)] = 0.01  # share of the error that another force has to save
    spacing_px: Positive = 4.0  # between the points of the outline that are compared

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the cloth at the estimated pose under the best of the forces that are tried."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes:
            return cloth
        surface = model.surface(estimate.pose, cloth)

        def error(vertices: F64) -> float:
            return float(misfit(dressed(surface, vertices), segmentation, model.scene.cameras, self.spacing_px).sum())

        best, least = cloth, error(cloth.vertices)
        enough = (1 - self.least_gain) * least
        for trials in self._rounds(garment, first=len(past.moments) < FIRST_FRAMES):
            parameters = trials(best.parameters)
            drapes = model.drapes(estimate.pose, parameters, past)
            errors = [error(vertices) for vertices in drapes]
            if min(errors) < least:
                k = int(np.argmin(errors))
                best, least = Cloth(vertices=drapes[k].copy(), parameters=parameters[k].copy()), errors[k]
        return best if least < enough else cloth

    def _rounds(self, garment: GarmentMesh, first: bool) -> Iterator[Callable[[F64], F64]]:
        """Yield what makes parameters (B, Q) to try of the best (Q,) so far."""
        if first:
            for columns, values in samples.coarse(garment, self.directions, np.radians(self.amounts_deg)):
                yield partial(samples.replaced, garment, columns=columns, values=values)
        for k in range(self.rounds):
            tilt, thickness = np.radians(self.step_deg) / 2**k, first * self.step_mm / 1000 / 2**k
            yield partial(samples.neighbours, garment, tilt=tilt, thickness=thickness)
