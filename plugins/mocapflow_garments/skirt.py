"""A skirt: a grid of strands from waist to hem."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mocapflow.assets import Body, GarmentMesh
from mocapflow.dressing.roles import Garment
from mocapflow.errors import GarmentError
from mocapflow.geometry import sewing
from mocapflow.records import F64
from mocapflow_garments import pattern, sections


class Skirt(Garment):
    """A skirt sewn from four tape measures; hangs from a waistband that follows the skin under it."""

    name: ClassVar[str] = "skirt"
    waist_height_m: pattern.Length  # height of the upper edge above the floor, rest pose
    waist_circumference_m: pattern.Length  # length of the upper edge
    hem_circumference_m: pattern.Length  # length of the lower edge
    length_m: pattern.Length  # from the upper to the lower edge, along the cloth
    strands: Annotated[int, Field(ge=8, le=512)] = 48  # columns of particles
    rings: Annotated[int, Field(ge=3, le=512)] = 24  # rows of particles
    force_orders: tuple[Literal[0, 1, 2, 3], ...] = (0, 1, 2)  # harmonics of the tail angle; 1 alone is a wind

    def sew(self, body: Body) -> GarmentMesh:
        """Return the skirt around the rest body, spread as its pattern allows."""
        self._check()
        torso, away = pattern.waistband(self.name, body, self.waist_height_m, self.waist_circumference_m)
        waist, facing = sections.band(torso, away, self.strands)
        down = np.linspace(0.0, self.length_m, self.rings)
        straight = np.linspace(sections.perimeter(waist), self.hem_circumference_m, self.rings)
        around = pattern.hip_rings(body, self.waist_height_m, down, straight, away)
        rows = self._cone(waist, facing, around, self.length_m / (self.rings - 1))
        parameters = sewing.with_take_up(sewing.force_parameters(self.force_orders))
        repairs = sewing.widened(
            waist_circumference_m=(self.waist_circumference_m, around[0]),
            hem_circumference_m=(self.hem_circumference_m, around[-1]),
        )
        return sewing.sheet(self.name, body, rows, closed=True, around=around, parameters=parameters, repairs=repairs)

    def _check(self) -> None:
        if self.length_m > self.waist_height_m:
            raise GarmentError(
                f"skirt: the hem would hang {self.length_m - self.waist_height_m:.2f} m below the floor",
                hint="length_m is measured along the cloth, waist_height_m is its upper edge above the floor;\n"
                "shorten length_m or raise waist_height_m",
            )
        if self.hem_circumference_m > self.waist_circumference_m + 2 * math.pi * self.length_m:
            raise GarmentError(
                f"skirt: a hem of {self.hem_circumference_m:.2f} m is wider than a full circle of this length",
                hint=f"at most {self.waist_circumference_m + 2 * math.pi * self.length_m:.2f} m for these measures",
            )

    def _cone(self, waist: F64, facing: F64, around: F64, link: float) -> F64:
        """Return vertices (strands, rings, 3) m on straight-sided rings, each row one link below the last."""
        out = np.concatenate([[0.0], np.cumsum(np.clip(np.diff(around) / (2 * math.pi), None, 0.999 * link))])
        down = np.concatenate([[0.0], np.cumsum(np.sqrt(link**2 - np.diff(out) ** 2))])
        flat = waist[:, None] + out[None, :, None] * facing[:, None]
        height = np.broadcast_to(self.waist_height_m - down, flat.shape[:2])
        return np.concatenate([flat, height[..., None]], axis=-1)
