"""How well the points of the model's contour are known."""

from __future__ import annotations

import numpy as np

from mocapflow.data import BODY, CLOTH, Contour, Surface
from mocapflow.geometry.contours import nearest_compatible
from mocapflow.records import F64
from mocapflow.scene import Scene

ANY_DIRECTION = -1.0  # least cosine between normals


def contour_sigma(
    model: Contour, surface: Surface, scene: Scene, skin_px: float, cloth_px_per_m: float, hem_guard_px: float = 12.0
) -> F64:
    """Return the standard deviation (K,) px of model points: large on cloth, and on skin where a hem may be.

    The outline of hanging cloth must not turn a knee: `cloth_px_per_m` of the length it hangs from is added. Skin
    within `hem_guard_px` of the cloth's edge, where the image may show cloth, is as uncertain as the cloth beside it.
    """
    sigma = np.full(len(model.vertex), skin_px)
    cloth = np.flatnonzero(surface.layer[model.vertex] == CLOTH)
    sigma[cloth] += cloth_px_per_m * scene.hanging[model.vertex[cloth] - len(scene.body.vertices)]
    skin = np.flatnonzero(surface.layer[model.vertex] == BODY)
    skin = skin[scene.near_garment[model.vertex[skin]]]
    if len(cloth) and len(skin) and hem_guard_px:
        one, other = ((model.pixel.take(k, axis=0), model.normal.take(k, axis=0)) for k in (skin, cloth))
        beside = nearest_compatible(*one, *other, hem_guard_px, ANY_DIRECTION)
        sigma[skin[beside >= 0]] = sigma[cloth[beside[beside >= 0]]]
    return sigma
