"""Shorts: strands from the waist down each leg's outside, and from the crotch seam down its inside."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mocapflow.assets import Body, GarmentMesh
from mocapflow.dressing.roles import Garment
from mocapflow.errors import GarmentError
from mocapflow.geometry import sewing
from mocapflow.records import F64, I32
from mocapflow_garments import pattern, sections

OUTER = 0.75  # share of a leg's strands that begin at the waist; the others begin at the crotch seam
TOUCHING = 0.05  # m below the crotch seam over which the skin of the thighs may still touch
CROTCH = 1.2  # a leg's length around at the crotch over half the hip's: the seam adds what reaches between the legs


class Shorts(Garment):
    """Shorts sewn from six tape measures: two tubes joined at the hip, each carried by its thigh."""

    name: ClassVar[str] = "shorts"
    waist_height_m: pattern.Length  # height of the upper edge above the floor, rest pose
    waist_circumference_m: pattern.Length  # length of the upper edge
    hip_circumference_m: pattern.Length  # length around the cloth at its widest
    leg_opening_circumference_m: pattern.Length  # length of each hem
    inseam_m: pattern.Length  # from the crotch to the hem
    length_m: pattern.Length  # from the upper edge to the hem along the outside of the leg
    strands: Annotated[int, Field(ge=8, le=512, multiple_of=4)] = 32  # columns of particles of each leg
    rings: Annotated[int, Field(ge=6, le=512)] = 20  # rows of particles
    force_orders: tuple[Literal[0, 1, 2, 3], ...] = (0, 1, 2)  # harmonics of the tail angle; 1 alone is a wind

    def sew(self, body: Body) -> GarmentMesh:
        """Return the shorts on the rest body."""
        self._check()
        link = self.length_m / (self.rings - 1)
        crotch = min(max(round((self.length_m - self.inseam_m) / link), 1), self.rings - 2)  # row
        outer, inner, around = self._place(body, link, crotch)
        vertices = np.concatenate([outer.reshape(-1, 3), inner.reshape(-1, 3)])
        long, short = np.split(np.arange(len(vertices), dtype=np.int32), [outer[..., 0].size])
        long, short = long.reshape(outer.shape[:2]), short.reshape(inner.shape[:2])
        legs = _legs(long, short, crotch)
        rings, ring_length = _rings(long, legs, crotch, around)
        strands = np.concatenate([long, np.pad(short, ((0, 0), (0, crotch)), constant_values=-1)])
        pinned = strands[:, 0].copy()
        pinned_to = sewing.nearest_skin(body, vertices[pinned])
        names, bounds = sewing.force_parameters(self.force_orders)
        faces = [sewing.grid_faces(long[:, : crotch + 1]), *(sewing.grid_faces(leg) for leg in legs)]
        return GarmentMesh(
            name=self.name,
            vertices=vertices,
            faces=np.concatenate(faces),
            strands=strands,
            rings=rings,
            ring_length=ring_length,
            carried_by=_carried_by(body, vertices, legs, pinned_to[: len(long)]),
            pinned=pinned,
            pinned_to=pinned_to,
            parameter_names=names,
            parameter_bounds=bounds,
            repairs=sewing.widened(
                waist_circumference_m=(self.waist_circumference_m, around[0]),
                hip_circumference_m=(self.hip_circumference_m, around[:crotch].max()),
                leg_opening_circumference_m=(self.leg_opening_circumference_m, around[-1]),
            ),
        )

    def _check(self) -> None:
        if self.inseam_m >= self.length_m:
            raise GarmentError(
                f"shorts: the inseam ({self.inseam_m:.2f} m) is as long as the outside ({self.length_m:.2f} m)",
                hint="length_m runs from the waist's upper edge to the leg opening, inseam_m from the crotch",
            )
        if self.length_m > self.waist_height_m:
            raise GarmentError(
                f"shorts: the legs would end {self.length_m - self.waist_height_m:.2f} m below the floor",
                hint="shorten length_m or raise waist_height_m, the upper edge above the floor",
            )

    def _place(self, body: Body, link: float, crotch: int) -> tuple[F64, F64, F64]:
        """Return outer strands (2 K, rings, 3), inner strands and the length around of each row's rings (rings,)."""
        torso, away = pattern.waistband(self.name, body, self.waist_height_m, self.waist_circumference_m)
        front = sections.level(self.waist_height_m, -math.pi / 2)
        turned = sections.outline(torso @ sections.level(0.0).across[:, :2] @ front.across[:, :2].T)
        count = round(OUTER * self.strands)
        waist, facing = sections.band(turned, away, 2 * count, 0.5)
        down = np.linspace(0.0, link * crotch, crotch + 1)
        straight = np.linspace(sections.perimeter(waist), self.hip_circumference_m, crotch + 1)
        hips = pattern.hip_rings(body, self.waist_height_m, down, straight, away)
        top = max(CROTCH * hips[-1] / 2, self.leg_opening_circumference_m)
        leg = np.linspace(top, self.leg_opening_circumference_m, self.rings - crotch)
        heights = self.waist_height_m - np.linspace(link * crotch, self.length_m, self.rings - crotch)
        tubes, thighs = zip(*(self._tube(body, side, heights, leg) for side in (1.0, -1.0)), strict=True)
        leg = np.maximum(leg, np.max(thighs, axis=0))
        lower = np.concatenate([tube[:count] for tube in tubes])
        upper = self._hips(body, front.lift(waist), lower[:, 0], facing @ front.across, away, crotch)
        outer = pattern.even_links(np.concatenate([upper, lower], axis=1), link)
        inner = pattern.even_links(np.concatenate([tube[count:] for tube in tubes]), link)
        return outer, inner, np.concatenate([hips[:-1], leg])

    def _hips(self, body: Body, waist: F64, seam: F64, facing: F64, away: float, crotch: int) -> F64:
        """Return the rows (strands, crotch, 3) between waist and legs: straight, but around the hips."""
        share = np.linspace(0.0, 1.0, crotch + 1)[:-1, None]
        rows: F64 = waist[:, None] * (1 - share) + seam[:, None] * share
        for row in range(1, crotch):
            height = float(rows[:, row, 2].mean())
            torso = max(sections.outlines(body, sections.level(height)), key=sections.perimeter)
            reach = (facing[:, :2] @ torso.T).max(axis=1) + away
            rows[:, row] += np.maximum(reach - (rows[:, row] * facing).sum(axis=1), 0.0)[:, None] * facing
        return rows

    def _tube(self, body: Body, side: float, heights: F64, around: F64) -> tuple[F64, F64]:
        """Return the rings (strands, rows, 3) of the leg on one side, and the least length (rows,) around it.

        Strands run on from the waist's.
        """
        start = math.radians(-135.0 if side > 0 else 45.0)
        rows, least = [], []
        for height, length in zip(heights, around, strict=True):
            plane = sections.level(height, start)
            closed = _leg(body, side, height, start)
            tape = sections.perimeter(closed)
            measure = f"the leg above a leg_opening_circumference_m of {self.leg_opening_circumference_m:.2f} m"
            away = pattern.room(self.name, measure, length, tape)
            rows.append(plane.lift(sections.band(closed, away, self.strands, 0.5)[0]))
            least.append(tape + 2 * math.pi * pattern.EASE)
        return np.stack(rows, axis=1), np.array(least)


def _legs(long: I32, short: I32, crotch: int) -> list[I32]:
    """Return the vertices (strands, rows) of each leg's tube, round the leg."""
    pairs = zip(np.split(long[:, crotch:], 2), np.split(short, 2), strict=True)
    return [np.concatenate([outer, inner]) for outer, inner in pairs]


def _carried_by(body: Body, vertices: F64, legs: list[I32], waist_skin: I32) -> I32:
    carried = np.full(len(vertices), sewing.carrier(body, waist_skin), np.int32)
    for leg in legs:
        thigh = vertices[leg[:, : leg.shape[1] // 2 + 1]].reshape(-1, 3)  # a long leg ends at the shank
        carried[leg] = sewing.carrier(body, sewing.nearest_skin(body, thigh))
    return carried


def _leg(body: Body, side: float, height: float, start: float) -> F64:
    """Return the outline (N, 2) of the leg on one side; where thighs still touch, that of where they part below."""
    middle = pattern.middle(body)[0]
    for lower in np.linspace(0.0, TOUCHING, 11):
        plane = sections.level(height - lower, start)
        beside = [(side * (plane.lift(o)[:, 0].mean() - middle), o) for o in sections.outlines(body, plane)]
        legs = [(away, o) for away, o in beside if away > 0.02 and sections.perimeter(o) > 0.2]
        if legs:
            return min(legs, key=lambda leg: leg[0])[1]
    raise GarmentError(
        f"shorts: the legs have not parted yet at {height:.2f} m, where the crotch should be",
        hint="waist_height_m - (length_m - inseam_m) must lie below the body's crotch, and the body look along -y\n"
        f"{pattern.WHOSE}",
    )


def _rings(long: I32, legs: list[I32], crotch: int, around: F64) -> tuple[I32, F64]:
    """Return links (E, 2) around hips and legs and their lengths (E,)."""
    rings, lengths = [], []
    for row, length in enumerate(around):
        loops = [long[:, row]] if row < crotch else [leg[:, row - crotch] for leg in legs]
        for loop in loops:
            rings.append(np.stack([loop, np.roll(loop, -1)], axis=1))
            lengths.append(np.full(len(loop), length / len(loop)))
    return np.concatenate(rings), np.concatenate(lengths)
