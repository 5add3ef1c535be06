"""A tube of cloth on any limb: a sleeve, a trouser leg, a sock."""

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


class Cylinder(Garment):
    """A tube pinned around a limb at its upper end, running along the limb; it may reach over the next joint."""

    name: ClassVar[str] = "cylinder"
    joint: str = "hip_l"  # the joint at the upper end of the limb
    start: Annotated[float, Field(ge=0, le=1)] = 0.3  # where the tube is pinned, as a share of the limb from the joint
    upper_circumference_m: pattern.Length = 0.60  # length of the upper edge, where it is pinned
    lower_circumference_m: pattern.Length = 0.55  # length of the hem
    length_m: pattern.Length = 0.40  # from the upper edge to the hem, along the cloth
    strands: Annotated[int, Field(ge=8, le=512)] = 32  # columns of particles
    rings: Annotated[int, Field(ge=3, le=512)] = 16  # rows of particles
    force_orders: tuple[Literal[0, 1, 2, 3], ...] = (0, 1)  # harmonics of the tail angle; 1 alone is a wind

    def sew(self, body: Body) -> GarmentMesh:
        """Return the tube on the rest body."""
        plane, outline, away = self._upper(body)
        band, facing = sections.band(outline, away, self.strands)
        sewn = max(self.upper_circumference_m, sections.perimeter(band))
        band, facing = band[::-1], facing[::-1]  # the plane is seen from above: its normal points down the limb
        around = np.linspace(sewn, self.lower_circumference_m, self.rings)
        out = (around - around[0]) / (2 * math.pi)
        link = self.length_m / (self.rings - 1)
        along = np.linspace(0.0, self.length_m, self.rings)
        rows = plane.lift(band[:, None] + out[None, :, None] * facing[:, None])
        rows = pattern.even_links(rows + along[:, None] * plane.normal, link)
        carried = [sewing.carrier(body, sewing.nearest_skin(body, rows[:, row])) for row in range(self.rings)]
        return sewing.sheet(
            f"{self.name}_{self.joint}",
            body,
            rows,
            closed=True,
            around=around,
            carried_by=np.array(carried, np.int32),
            parameters=sewing.force_parameters(self.force_orders),
            repairs=sewing.widened(upper_circumference_m=(self.upper_circumference_m, sewn)),
        )

    def _upper(self, body: Body) -> tuple[sections.Plane, F64, float]:
        """Return the plane across the limb, the limb's outline in it, and the tube's distance from that."""
        joint = body.joint(self.joint)
        below = np.flatnonzero(body.parents == joint)
        if not len(below):
            raise GarmentError(
                f"cylinder: nothing follows joint '{self.joint}'", hint="name the joint at the upper end of a limb"
            )
        limb = body.positions[below[0]] - body.positions[joint]
        plane = _across(body.positions[joint] + self.start * limb, limb)
        outlines = sections.outlines(body, plane)
        if not outlines:
            raise GarmentError(f"cylinder: there is no body around '{self.joint}'", hint="change `start`")
        outline = min(outlines, key=lambda closed: float(np.linalg.norm(closed.mean(axis=0))))
        tape = sections.perimeter(outline)
        place = "`start` (near 0 the trunk is measured with the limb)"
        away = pattern.room(
            f"{self.name}_{self.joint}", "upper_circumference_m", self.upper_circumference_m, tape, place
        )
        return plane, outline, away


def _across(point: F64, limb: F64) -> sections.Plane:
    """Return the plane across a limb at a point; its normal points down the limb."""
    normal = limb / np.linalg.norm(limb)
    first = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    first /= np.linalg.norm(first)
    return sections.Plane(point=point, across=np.stack([first, np.cross(normal, first)]))
