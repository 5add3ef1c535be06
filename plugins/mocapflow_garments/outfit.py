"""Several garments worn at once: a skirt with two sleeves."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from mocapflow.assets import Body, GarmentMesh
from mocapflow.dressing.guards import mesh_of
from mocapflow.dressing.roles import Garment
from mocapflow.geometry.outfits import together


class Outfit(Garment):
    """Garments that are sewn, draped and fitted each by itself, and seen together; they do not touch each other."""

    name: ClassVar[str] = "outfit"
    garments: Annotated[tuple[Garment, ...], Field(min_length=1)]  # what is worn, each with its settings

    def sew(self, body: Body) -> GarmentMesh:
        """Return all of them on the rest body."""
        return together(self.name, [mesh_of(garment, body) for garment in self.garments])
