"""How far the outline of a surface is off the silhouettes of a frame, read from their distance fields."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import CLOTH, Contour, Segmentation, Silhouette, Surface
from mocapflow.geometry.silhouettes import mask_distance, occluding_contour
from mocapflow.records import F32, F64


def misfit(
    surface: Surface,
    segmentation: Segmentation,
    cameras: Sequence[Camera],
    spacing_px: float,
    bend_px: F64 | None = None,
) -> F64:
    """Return the integral along the model's outline of its squared distance to the silhouette, per view (C,) px³.

    It is what the area term of section 12.4 measures, without drawing the surface: where two contours are d apart,
    their distance fields differ by d all across the band. Zero where a view has no silhouette. From `bend_px` (C,)
    on the square gives way to its tangent (Huber), so that few points far off do not outweigh all others.
    """
    error = np.zeros(len(cameras))
    for silhouette, contour in outlines(surface, segmentation, cameras, spacing_px):
        off = np.abs(bilinear(silhouette.distance, contour.pixel))
        near = off if bend_px is None else np.minimum(off, bend_px[silhouette.camera])
        error[silhouette.camera] = spacing_px * float(near @ (2 * off - near))
    return error


def unclipped(segmentation: Segmentation) -> Segmentation:
    """Return a segmentation whose distances go on beyond their band, to a pixel: cloth may hang farther off."""
    found = tuple(replace(each, distance=_beyond_band(each.distance)) for each in segmentation.silhouettes)
    return replace(segmentation, silhouettes=found)


def _beyond_band(distance: F32) -> F32:
    inside = distance > 0
    if not inside.any():
        return distance
    band = float(np.abs(distance).max())
    return np.where(np.abs(distance) < band - 1, distance, mask_distance(inside))


def outlines(
    surface: Surface, segmentation: Segmentation, cameras: Sequence[Camera], spacing_px: float
) -> Iterator[tuple[Silhouette, Contour]]:
    """Yield every silhouette of the person with the occluding contour of the surface in its view."""
    for silhouette in segmentation.of("person"):
        yield silhouette, occluding_contour(surface, cameras[silhouette.camera], spacing_px)


def dressed(surface: Surface, cloth: F64) -> Surface:
    """Return a surface with its cloth (W, 3) m hanging another way."""
    return replace(surface, vertices=np.concatenate([surface.vertices[surface.layer != CLOTH], cloth]))


def bilinear(field: F32 | F64, pixels: F64) -> F64:
    """Return a field (H, W) between its pixels, at (K, 2) px; outside the image the value at its edge."""
    height, width = field.shape
    x, y = np.clip(pixels[:, 0], 0, width - 1.001), np.clip(pixels[:, 1], 0, height - 1.001)
    column, row = x.astype(int), y.astype(int)
    right, down = x - column, y - row
    above = (1 - right) * field[row, column] + right * field[row, column + 1]
    below = (1 - right) * field[row + 1, column] + right * field[row + 1, column + 1]
    value: F64 = (1 - down) * above + down * below
    return value
