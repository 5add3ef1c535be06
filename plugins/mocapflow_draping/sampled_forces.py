"""The chapter's cloth fitter: try forces, keep the one under which the outline fits the images best."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat

from mocapflow.assets import GarmentMesh
from mocapflow.components import ClothFitter
from mocapflow.data import Cloth, Estimate, Frame, Past, Segmentation, Turn
from mocapflow.geometry.sewing import THICKNESS
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow_draping import samples
from mocapflow_draping.outline import outline_error

FIRST_FRAMES = 2  # in which every direction is tried
STEP = np.radians(5.0)  # of a force, in the first round of the refinement; half as much each further round
THICKNESS_STEP = 0.001  # m, likewise


class SampledForces(ClothFitter):
    """Tries directions and amounts of every force and refines the best, one force after the other.

    Later frames try only calm cloth, so that a search that was led astray comes back, and around the last best. Each
    force is held near zero: where strands lie on the body a force does not show, and any would do. Beyond one standard
    deviation an error counts by its distance, not its square: no force lifts a hem that hangs too low, and a narrower
    skirt would pay for it. The thickness of a cloth does not change: it is searched for in the first frames and kept.

    Source: Rosenhahn 2008, section 12.4
    """

    name: ClassVar[str] = "sampled_forces"
    directions: Annotated[int, Field(ge=2)] = 8  # directions that are tried of a force with two components
    amounts_deg: tuple[PositiveFloat, ...] = (5.0, 10.0, 20.0)  # amounts that are tried in each direction
    rounds: NonNegativeInt = 3  # rounds of the refinement
    least_gain: Annotated[float, Field(ge=0, lt=1)] = 0.01  # share of the error that other forces have to save
    force_sd_deg: PositiveFloat = 6.0  # standard deviation of each force about zero

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the cloth at the estimated pose under the best of the forces that are tried."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes:
            return cloth
        outline = outline_error(estimate.pose, cloth, segmentation, model)
        forces = sum(samples.forces(garment), [])

        def error(vertices: F64, parameters: F64) -> float:
            """Sum the squares, in standard deviations, of what the outline is off (Huber) and of all forces."""
            amounts = np.degrees(parameters[forces]) / self.force_sd_deg
            return outline(vertices) + float(amounts @ amounts)

        best, least = cloth, error(cloth.vertices, cloth.parameters)
        enough = (1 - self.least_gain) * least
        for trials in self._rounds(garment, first=len(past.moments) < FIRST_FRAMES):
            parameters = trials(best.parameters)
            drapes = model.drapes(estimate.pose, parameters, past)
            errors = [error(*trial) for trial in zip(drapes, parameters, strict=True)]
            if min(errors) < least:
                k = int(np.argmin(errors))
                best, least = Cloth(vertices=drapes[k].copy(), parameters=parameters[k].copy()), errors[k]
        return best if least < enough else cloth

    def _rounds(self, garment: GarmentMesh, first: bool) -> Iterator[Callable[[F64], F64]]:
        """Yield what makes parameters (B, Q) to try of the best (Q,) so far."""
        forces = samples.forces(garment)
        if first:
            for columns, values in samples.coarse(garment, self.directions, np.radians(self.amounts_deg)):
                yield partial(samples.replaced, garment, columns=columns, values=values)
        else:
            every = sum(forces, [])
            yield partial(samples.replaced, garment, columns=every, values=np.zeros((1, len(every))))
        for k in range(self.rounds):
            for columns in forces:
                yield partial(samples.neighbours, garment, columns=columns, step=STEP / 2**k)
            for column in garment.columns(THICKNESS) if first else ():
                yield partial(samples.neighbours, garment, columns=[column], step=THICKNESS_STEP / 2**k)
