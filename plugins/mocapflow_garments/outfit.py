"""Several garments worn at once: a skirt with two sleeves."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from mocapflow.assets import Body, GarmentMesh
from mocapflow.dressing.guards import mesh_of
from mocapflow.dressing.roles import Garment
from mocapflow.errors import GarmentError
from mocapflow.geometry.outfits import together


class Outfit(Garment):
    """Garments that are sewn and draped each by itself, with forces of its own; they do not touch each other."""

    name: ClassVar[str] = "outfit"
    garments: Annotated[tuple[Garment, ...], Field(min_length=1)]  # what is worn, each with its settings

    def sew(self, body: Body) -> GarmentMesh:
        """Return all of them on the rest body.

        Raises:
            GarmentError: two of them are the same, in the same place.
        """
        for k, garment in enumerate(self.garments):
            if garment in self.garments[:k]:
                message = f"garment {k + 1} of the outfit is the same {garment.name} as an earlier one"
                raise GarmentError(message, hint="change what sets them apart, such as the joint, or leave one out")
        return together(self.name, [mesh_of(garment, body) for garment in self.garments])
