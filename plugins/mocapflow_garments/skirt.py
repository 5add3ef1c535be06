"""A skirt: a grid of strands from waist to hem."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mocapflow.components import Garment
from mocapflow.data import Body, GarmentMesh
from mocapflow.records import F64
from mocapflow_garments import pattern, sections

LARGEST_ROOM = 0.08  # m between waistband and skin: more can't hold a skirt up


class Skirt(Garment):
    """A skirt sewn from four tape measures; hangs from a waistband that follows the skin under it."""

    name: ClassVar[str] = "skirt"
    waist_height_m: float  # upper edge above the floor, rest pose
    waist_circumference_m: float
    hem_circumference_m: float
    length_m: float  # along the cloth
    strands: Annotated[int, Field(ge=8)] = 48
    rings: Annotated[int, Field(ge=3)] = 24
    force_orders: tuple[Literal[0, 1, 2], ...] = (0, 1, 2)  # harmonics of the tail angle; 1 alone is a wind

    def sew(self, body: Body) -> GarmentMesh:
        """Return the skirt around the rest body, spread as its pattern allows."""
        self._check(body)
        waist, facing, away = self._waistband(body)
        around = self._ring_lengths(body, sections.perimeter(waist), away)
        link = self.length_m / (self.rings - 1)
        vertices = self._cone(waist, facing, around, link)
        grid = np.arange(self.strands * self.rings, dtype=np.int32).reshape(self.strands, self.rings)
        pinned_to = pattern.nearest_skin(body, vertices[:, 0])
        names, bounds = pattern.parameters(self.force_orders)
        return GarmentMesh(
            name=self.name,
            vertices=vertices.reshape(-1, 3),
            faces=pattern.grid_faces(grid),
            strands=grid,
            rings=np.stack([grid.T, np.roll(grid, -1, axis=0).T], axis=-1).reshape(-1, 2),
            ring_length=np.repeat(around / self.strands, self.strands),
            carried_by=np.full(grid.size, pattern.main_joint(body, pinned_to), np.int32),
            pinned=grid[:, 0].copy(),
            pinned_to=pinned_to,
            parameter_names=names,
            parameter_bounds=bounds,
        )

    def _check(self, body: Body) -> None:
        tapes = ("waist_height_m", "waist_circumference_m", "hem_circumference_m", "length_m")
        pattern.check_measures(self.name, {tape: getattr(self, tape) for tape in tapes})
        if self.length_m > self.waist_height_m:
            raise pattern.GarmentError(
                f"skirt: the hem would hang {self.length_m - self.waist_height_m:.2f} m below the floor",
                hint="length_m is measured along the cloth, waist_height_m is its upper edge above the floor;\n"
                "shorten length_m or raise waist_height_m",
            )
        if self.hem_circumference_m > self.waist_circumference_m + 2 * math.pi * self.length_m:
            raise pattern.GarmentError(
                f"skirt: a hem of {self.hem_circumference_m:.2f} m is wider than a full circle of this length",
                hint=f"at most {self.waist_circumference_m + 2 * math.pi * self.length_m:.2f} m for these measures",
            )

    def _waistband(self, body: Body) -> tuple[F64, F64, float]:
        found = sections.sections(body, sections.level(self.waist_height_m))
        outlines = [sections.outline(points) for points in found]
        if not outlines:
            top = float(body.vertices[:, 2].max())
            raise pattern.GarmentError(
                f"skirt: there is no body at waist_height_m = {self.waist_height_m:.2f}",
                hint=f"the rest body ends at {top:.2f} m; waist_height_m is metres above the floor",
            )
        torso = max(outlines, key=sections.perimeter)
        tape = sections.perimeter(torso)
        away = (self.waist_circumference_m - tape) / (2 * math.pi)
        if away > LARGEST_ROOM:
            raise pattern.GarmentError(
                f"skirt: a waist of {self.waist_circumference_m:.2f} m can't stay up on a body of {tape:.2f} m there",
                hint="check waist_circumference_m and waist_height_m",
            )
        if away < pattern.EASE:
            fits = tape + 2 * math.pi * pattern.EASE
            pattern.repaired(
                self.name,
                f"waist_circumference_m {self.waist_circumference_m:.3f} lies inside the body; widened to {fits:.3f}",
            )
            away = pattern.EASE
        ring, facing = sections.band(torso, away, self.strands)
        return ring, facing, away

    def _ring_lengths(self, body: Body, waist: float, away: float) -> F64:
        """Return the length around (rings,) m: straight from waist to hem, but never tighter than the hips."""
        down = np.linspace(0.0, self.length_m, self.rings)
        around = np.linspace(waist, max(self.hem_circumference_m, waist), self.rings)
        for row, below in enumerate(down):
            found = sections.sections(body, sections.level(self.waist_height_m - below))
            outlines = [sections.outline(points) for points in found]
            middle = [closed for closed in outlines if _holds_middle(closed, outlines)]
            if not middle:  # the legs have parted
                break
            around[row] = max(around[row], sections.perimeter(middle[0]) + 2 * math.pi * away)
        return np.maximum.accumulate(around)

    def _cone(self, waist: F64, facing: F64, around: F64, link: float) -> F64:
        """Return vertices (strands, rings, 3) m on straight-sided rings, each row one link below the last."""
        out = np.concatenate([[0.0], np.cumsum(np.clip(np.diff(around) / (2 * math.pi), None, 0.999 * link))])
        down = np.concatenate([[0.0], np.cumsum(np.sqrt(link**2 - np.diff(out) ** 2))])
        flat = waist[:, None] + out[None, :, None] * facing[:, None]
        height = np.broadcast_to(self.waist_height_m - down, flat.shape[:2])
        return np.concatenate([flat, height[..., None]], axis=-1)


def _holds_middle(closed: F64, outlines: list[F64]) -> bool:
    """Return True for the outline around the middle of all, e.g. the torso between the arms."""
    corners = np.concatenate(outlines)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    edge = np.roll(closed, -1, axis=0) - closed
    to = middle - closed
    return bool(np.all(edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0] >= 0))
