"""A cape that hangs from the shoulders: a complete garment plugin."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from mocapflow import Body, Garment, GarmentError, GarmentMesh, hookimpl
from mocapflow.geometry import sewing

UP = np.array([0.0, 0.0, 1.0])
BEHIND = 0.3  # m behind the shoulders: the skin nearest to there is the back's
ROOM = 0.01  # m between back and cloth
LEAN = 0.3  # of its length the hem stands back at rest: the way from which the strands fall

Length = Annotated[float, Field(gt=0, lt=4)]


class Cape(Garment):
    """A sheet of cloth behind the body, pinned from one shoulder to the other."""

    name: ClassVar[str] = "cape"
    length_m: Length = 1.0  # along the cloth
    hem_m: Length = 0.9  # from one lower corner to the other
    strands: Annotated[int, Field(ge=4)] = 24
    rings: Annotated[int, Field(ge=3)] = 20

    def sew(self, body: Body) -> GarmentMesh:
        """Return the cape behind the rest body, spread as its pattern allows."""
        left, right = body.positions[body.joint("shoulder_l")], body.positions[body.joint("shoulder_r")]
        across = (right - left) / np.linalg.norm(right - left)
        back = np.cross(across, UP)
        line = np.linspace(left, right, self.strands)  # from above, counter-clockwise around the body
        skin = body.vertices[sewing.nearest_skin(body, line + BEHIND * back)]
        upper = line + (((skin - line) @ back).max() + ROOM) * back
        hem = upper.mean(axis=0) + np.linspace(-0.5, 0.5, self.strands)[:, None] * self.hem_m * across
        hem += LEAN * self.length_m * back
        away = np.linalg.norm(hem - upper, axis=1, keepdims=True)
        if (away >= self.length_m).any():
            raise GarmentError(f"cape: a hem of {self.hem_m:.2f} m is too wide", hint="at most twice the length")
        lower = hem - np.sqrt(self.length_m**2 - away**2) * UP
        rows = np.linspace(upper, lower, self.rings, axis=1)
        parameters = sewing.force_parameters((1,))  # thickness, and a wind
        return sewing.sheet(self.name, body, rows, closed=False, parameters=parameters)


@hookimpl
def mocapflow_garments() -> list[type[Garment]]:
    """Return the garments of this plugin."""
    return [Cape]
