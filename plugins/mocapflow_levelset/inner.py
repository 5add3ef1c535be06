"""Inner contours of the person in one view: where parts end before others, looked for near their edges in the model."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Matches, Silhouette, Surface
from mocapflow.records import F64, I32, U8, Bool, picked_rows
from mocapflow.scene import Scene
from mocapflow_levelset import splits
from mocapflow_levelset.inner_edges import behind_edges, inner_edges
from mocapflow_levelset.layers import CLIP, ColourModel

SPACING_PX = 4.0  # between the points of an edge of the model
HALF_PX = 3  # on either side that colours have to agree over
LEAST = 1.0  # mean log ratio of colours from which on one side is told from the other
SIGMA_PX = 1.0  # standard deviation of a point; that by the noise of the colours is added


def findable_edges(scene: Scene, layers: I32, colours: ColourModel) -> Bool:
    """Return the vertices (N,) whose edges can be found.

    Those of cloth are left out but where it is pinned to the skin: where it hangs is not known well enough to say
    anything of what it lies before.
    """
    return scene.held & np.asarray(colours.distinct.any(axis=1)).take(layers)


def inner_contours(
    image: U8, silhouette: Silhouette, surface: Surface, camera: Camera, layers: I32, findable: Bool,
    colours: ColourModel, reach_px: int,
) -> Matches:  # fmt: skip
    """Return points of inner contours, each with the vertex at whose edge the part ends there.

    Args:
        image: (H, W, 3) BGR.
        silhouette: of the person in it.
        surface: as estimated, N vertices.
        camera: of the image.
        layers: (N,) of the vertices.
        findable: (N,) see `findable_edges`.
        colours: of layers.
        reach_px: how far along the normal of an edge the end of a part is looked for.
    """
    edges = inner_edges(surface, camera, SPACING_PX, findable)
    rough = splits.split(
        image, silhouette.distance, colours.ratio, layers[edges.vertex], edges.pixel, edges.normal, CLIP,
        reach_px, HALF_PX, LEAST,
    )  # fmt: skip
    ended = np.isfinite(rough)  # few, so that what is seen is looked up for few
    edges, rough = picked_rows(edges, ended), rough[ended]
    behind = behind_edges(surface, camera, edges)
    offset, noise = splits.refine(image, edges.pixel, edges.normal, rough, HALF_PX)
    pair = (behind >= 0) & colours.distinct[layers[edges.vertex], layers[behind]]
    pair &= np.abs(offset - rough) < HALF_PX
    edges, way = picked_rows(edges, pair), offset[pair]
    weight: F64 = 1 / (SIGMA_PX**2 + noise[pair])
    return Matches(
        camera=np.full(len(way), silhouette.camera, np.int16),
        pixel=edges.anchor + way[:, None] * edges.normal,
        direction=edges.normal,
        vertex=edges.vertex,
        weight=weight,
    )
