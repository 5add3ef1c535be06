"""How well the outline of draped cloth fits the silhouettes, as one number: what cloth fitters make small."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocapflow.data import Cloth, Pose, Segmentation
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.misfit import dressed, misfit, unclipped
from mocapflow.model import ClothedModel
from mocapflow.records import F64


def outline_error(
    pose: Pose,
    cloth: Cloth,
    segmentation: Segmentation,
    model: ClothedModel,
    *,
    sigma_mm: float,
    correlation_m: float,
    spacing_px: float,
) -> Callable[[F64], float]:
    """Return what sums the squares, in standard deviations, of what the outline is off (Huber) for other drapes.

    It takes vertices (W, 3) m of the cloth at the same pose.

    Args:
        pose: of the body.
        cloth: on it, as it is believed to hang: says how large a millimetre is in each view.
        segmentation: the silhouettes.
        model: the scene.
        sigma_mm: standard deviation of the outline; beyond it an error counts by its distance.
        correlation_m: length over which its errors agree.
        spacing_px: between the points of the outline that are compared.
    """
    surface, cameras = model.surface(pose, cloth), model.scene.cameras
    scale = np.array([magnification(camera, cloth.vertices.mean(axis=0)) for camera in cameras])
    bend = 1e-3 * sigma_mm * scale
    weight = 1 / (correlation_m * scale * bend**2)
    seen = unclipped(segmentation)

    def error(vertices: F64) -> float:
        return float(weight @ misfit(dressed(surface, vertices), seen, cameras, spacing_px, bend))

    return error
