"""The roles that make the clothed model: a body, the garment sewn on it, and how that hangs; see `components`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocapflow.assets import Body, GarmentMesh
from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.geometry.differences import drape_differences
from mocapflow.records import F64, I32, Bool
from mocapflow.settings import Component

if TYPE_CHECKING:
    from pathlib import Path

    from mocapflow.scene import Scene


class BodyModel(Component):
    """Loads a body."""

    role: ClassVar[str] = "body"

    @abstractmethod
    def load(self, folder: Path) -> Body:
        """Return the body at rest; `folder` is that of the recording."""

    def inputs(self, folder: Path) -> Sequence[Path]:
        """Return the files `load` reads: their content is part of the cache key."""
        return ()

    def need(self, folder: Path) -> None:
        """Raise the error that `load` would for lack of a file; called by `plan`, and before a run begins."""


class Garment(Component):
    """Sews a garment from tape measures."""

    role: ClassVar[str] = "garment"

    @abstractmethod
    def sew(self, body: Body) -> GarmentMesh:
        """Return the garment at rest on the rest body."""


class Draper(Component):
    """Lays a garment on posed bodies: the forward model. Of several that are worn it is given one at a time."""

    role: ClassVar[str] = "draper"

    @abstractmethod
    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return cloth vertices (B, W, 3) m in the world for B poses and parameters (B, Q); pure."""

    def velocity(self, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
        """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,) for unit changes of pose and parameters.

        The default takes differences of one batch of drapes.
        """
        assert scene.garment is not None

        def drape(poses: PoseBatch, values: F64) -> F64:
            return self.drape(poses, values, past, scene)[:, vertices]

        bounds = scene.garment.parameter_bounds
        return drape_differences(drape, scene.body, self.touchable(scene), bounds, pose, parameters)

    def touchable(self, scene: Scene) -> Bool:
        """Return which joints (J,) move what the garment hangs from or can touch; the rest never moves the cloth."""
        return np.ones(len(scene.body.parents), bool)
