"""How well the points of the model's contour are known."""

from __future__ import annotations

import numba
import numpy as np

from mocapflow.data import BODY, CLOTH, Contour, Surface
from mocapflow.geometry.contours import nearest_compatible
from mocapflow.records import F64
from mocapflow.scene import Scene

HEM_GUARD_PX = 12.0  # skin so near to cloth may be behind it
ANY_DIRECTION = -1.0  # least cosine between normals


def contour_sigma(
    model: Contour, surface: Surface, scene: Scene, skin_px: float, cloth_px_per_m: float, hem_guard_px: float
) -> F64:
    """Return the standard deviation (K,) px of model points: large on cloth, and on skin where a hem may be.

    The outline of hanging cloth must not turn a knee: `cloth_px_per_m` of the length it hangs from is added. Skin
    within `hem_guard_px` of the cloth's edge, where the image may show cloth, is as uncertain as the cloth beside it.
    """
    sigma: F64 = _sigma(
        model.vertex, model.pixel, model.normal, surface.layer, scene.hanging, scene.near_garment, skin_px,
        cloth_px_per_m, hem_guard_px,
    )  # fmt: skip
    return sigma


@numba.njit(cache=True)
def _sigma(  # type: ignore[no-untyped-def]
    vertex, pixel, normal, layer, hanging, near_garment, skin_px, cloth_px_per_m, hem_guard_px
):
    sigma = np.full(len(vertex), skin_px)
    of_layer = layer[vertex]
    cloth = np.flatnonzero(of_layer == CLOTH)
    for k in cloth:
        sigma[k] += cloth_px_per_m * hanging[vertex[k] - len(near_garment)]
    skin = np.array([k for k in np.flatnonzero(of_layer == BODY) if near_garment[vertex[k]]], np.int64)
    if hem_guard_px > 0:
        beside = nearest_compatible(pixel[skin], normal[skin], pixel[cloth], normal[cloth], hem_guard_px, ANY_DIRECTION)
        for k, found in zip(skin, beside):  # noqa: B905  # compiled code knows no strict
            if found >= 0:
                sigma[k] = sigma[cloth[found]]
    return sigma
