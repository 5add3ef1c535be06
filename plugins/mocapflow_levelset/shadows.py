"""Shadows that the person throws: on the floor around their feet, and how a segmenter tells them from the person."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat

from mocapflow.assets import Background, Camera
from mocapflow.components import Segmenter
from mocapflow.data import Frame, Surface
from mocapflow.geometry.cameras import project
from mocapflow.memo import memoised
from mocapflow.records import F64, U8, Bool
from mocapflow.scene import Scene
from mocapflow_levelset.plates import USUAL, Shadow
from mocapflow_levelset.shadow_consistency import no_shadows

CORNERS = 72
THIN = 4  # every so many-th pixel tells whether there are colours
GREY = 32  # levels between the colours of a pixel that has hardly any; bare skin has 20 to 75
FEW = 0.001  # share of the pixels that may have more: a stamp, a coloured lamp
REACH_M = 2.0  # from the person, where their shadow may fall


class ShadowAware(Segmenter):
    """A segmenter that compares pixels with the empty scene, lit and in the person's shadow."""

    spread_floor: PositiveFloat = USUAL.least_sd  # smallest standard deviation of the empty scene, share of the range
    shadow_share: Annotated[float, Field(ge=0, lt=1)] = USUAL.share  # prior share of shadows; 0: they count as changes
    darkest_shadow: Annotated[float, Field(gt=0, lt=1)] = USUAL.darkest  # least factor of a shadow on L + 16, a, b
    darkest_grey_shadow: Annotated[float, Field(gt=0, lt=1)] = 0.8  # the same in pictures without colours to tell it by

    def shadow(self, image: U8, background: Background | None, camera: int) -> Shadow:
        """Return what counts as background in an image (H, W, 3) of a camera, as it is set."""
        grey = background is not None and _grey_room(background, camera) and colourless(image)
        darkest = max(self.darkest_shadow, self.darkest_grey_shadow) if grey else self.darkest_shadow
        return Shadow(self.spread_floor, self.shadow_share, darkest)


def colourless(image: U8) -> bool:
    """Return whether an image (H, W, 3) has hardly any colours."""
    blue, green, red = np.moveaxis(image[::THIN, ::THIN], 2, 0)
    light, dark = np.maximum(np.maximum(blue, green), red), np.minimum(np.minimum(blue, green), red)
    return bool(np.mean(light - dark > GREY) < FEW)


@memoised
def _grey_room(background: Background, camera: int) -> bool:
    """Return whether the empty scene has hardly any colours: then the person tells whether the camera sees any."""
    return colourless(background.pictures[camera])


@memoised
def _circle(surface: Surface) -> F64:
    """Return points (CORNERS, 3) m of a circle around the person, on the floor."""
    feet = surface.vertices[:, 2].min()
    middle = surface.vertices[:, :2].mean(axis=0)
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle = middle + REACH_M * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.column_stack([circle, np.full(CORNERS, feet)])


def shadowed(frame: Frame, surface: Surface, scene: Scene, camera: int) -> Bool:
    """Return True for pixels (H, W) that may show the person's shadow, as far as the other views know."""
    floor = floor_around(surface, scene.cameras[camera])
    others = None if scene.background is None else no_shadows(frame, scene.background, scene.cameras)
    return floor if others is None else floor & ~others[camera]


def floor_around(surface: Surface, camera: Camera) -> Bool:
    """Return True for pixels (H, W) that show the floor within reach of the person.

    The floor is the horizontal plane through the lowest point of the posed surface. Elsewhere, a darker pixel of
    the same chromaticity is no shadow: grey cloth before a grey wall.
    """
    import cv2

    pixels = project(_circle(surface), camera)
    mask = np.zeros((camera.size[1], camera.size[0]), np.uint8)
    if not np.isfinite(pixels).all():  # the camera stands within reach
        mask[:] = 1
        return mask.view(bool)
    corners = np.rint(np.clip(pixels, -1e5, 1e5)).astype(np.int32)
    cv2.fillConvexPoly(mask, corners, 1)
    return mask.view(bool)
