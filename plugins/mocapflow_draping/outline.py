"""How far the outline of draped cloth is off the silhouettes, for fitters that try other drapes at one pose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocapflow.data import Cloth, Pose, Segmentation
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.misfit import dressed, misfit, unclipped
from mocapflow.model import ClothedModel
from mocapflow.records import F64

SIGMA = 0.015  # m, standard deviation of the outline of draped cloth
CORRELATION = 0.3  # m, length over which the outline's errors agree: half a skirt
SPACING_PX = 4.0  # between the points of the outline that are compared: contours are smooth


def outline_error(pose: Pose, cloth: Cloth, segmentation: Segmentation, model: ClothedModel) -> Callable[[F64], float]:
    """Return what sums the squares, in standard deviations, of what the outline is off (Huber) for other drapes.

    It takes vertices (W, 3) m of the cloth at the same pose. Beyond one standard deviation an error counts by its
    distance, not its square.

    Args:
        pose: of the body.
        cloth: on it, as estimated: says how large a millimetre is in each view.
        segmentation: the silhouettes.
        model: the scene.
    """
    surface, cameras = model.surface(pose, cloth), model.scene.cameras
    scale = np.array([magnification(camera, cloth.vertices.mean(axis=0)) for camera in cameras])
    bend = SIGMA * scale
    weight = 1 / (CORRELATION * scale * bend**2)
    seen = unclipped(segmentation)

    def error(vertices: F64) -> float:
        return float(weight @ misfit(dressed(surface, vertices), seen, cameras, SPACING_PX, bend))

    return error
