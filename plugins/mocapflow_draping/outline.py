"""Cloth fitters that compare the outline of draped cloth with the silhouettes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydantic import PositiveFloat

from mocapflow.components import ClothFitter
from mocapflow.data import Cloth, Pose, Segmentation
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.misfit import dressed, misfit, unclipped
from mocapflow.model import ClothedModel
from mocapflow.records import F64


class OutlineFitter(ClothFitter):
    """A cloth fitter that tries other drapes at one pose: it sums up how far the outline of each is off."""

    sigma_mm: PositiveFloat = 15.0  # standard deviation of the outline of draped cloth
    correlation_m: PositiveFloat = 0.3  # length over which the outline's errors agree: half a skirt
    spacing_px: PositiveFloat = 4.0  # between the points of the outline that are compared

    def outline_error(
        self, pose: Pose, cloth: Cloth, segmentation: Segmentation, model: ClothedModel
    ) -> Callable[[F64], float]:
        """Return what sums the squares, in standard deviations, of what the outline is off (Huber) for other drapes.

        It takes vertices (W, 3) m of the cloth at the same pose. Beyond one standard deviation an error counts by its
        distance, not its square.

        Args:
            pose: of the body.
            cloth: on it, as it is believed to hang: says how large a millimetre is in each view.
            segmentation: the silhouettes.
            model: the scene.
        """
        surface, cameras = model.surface(pose, cloth), model.scene.cameras
        scale = np.array([magnification(camera, cloth.vertices.mean(axis=0)) for camera in cameras])
        bend = 1e-3 * self.sigma_mm * scale
        weight = 1 / (self.correlation_m * scale * bend**2)
        seen = unclipped(segmentation)

        def error(vertices: F64) -> float:
            return float(weight @ misfit(dressed(surface, vertices), seen, cameras, self.spacing_px, bend))

        return error
