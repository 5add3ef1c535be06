"""The garment of a pipeline, not yet sewn: for stages that fit the body first."""

from __future__ import annotations

from collections.abc import Callable

from mocapflow.assets import Body, Camera, GarmentMesh
from mocapflow.records import record
from mocapflow.scene import Scene


@record
class Tailor:
    """The cameras (pinhole), a body that is not yet the person's, and how a garment is sewn to one.

    Measures that fit the person may not fit that body, so a stage that takes a `Scene` could not begin.
    """

    cameras: tuple[Camera, ...]
    body: Body
    sew: Callable[[Body], GarmentMesh | None]

    def dressed(self, body: Body) -> Scene:
        """Return the scene with a body in its garment.

        Raises:
            GarmentError: the garment can't be sewn on it.
        """
        return Scene(cameras=self.cameras, body=body, garment=self.sew(body))
