"""The silhouette of a surface in one view: its boundary, its mask, its signed distance.

The boundary comes from the occluding edges alone: an edge between a face that looks at the camera and one that
looks away, or the rim of an open mesh. Drawn with their direction, these edges say at every pixel how many
front faces cover it (a winding number), so a mask costs a few thousand short edges instead of thirty thousand
triangles, and nothing is drawn to tell which edges bound it. Cloth is two-sided: both its sides cover.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import BORDER, CLOTH, Contour, Surface
from mocapflow.geometry import boundary_kernels, span_kernels
from mocapflow.geometry import silhouette_kernels as kernels
from mocapflow.geometry.cameras import projection
from mocapflow.memo import memoised
from mocapflow.records import F32, F64, I8, I32, Bool, array, record

PIECE = 4.0  # px; longer edges are judged piece by piece, for a part of one may be hidden


class OccludingEdges(NamedTuple):
    """The directed occluding edges of a surface in one view, and where they cross the rows of the image."""

    vertex: I32  # (E, 2) surface vertex index of the two ends
    image: F64  # (E, 2, 2) px, where these project
    layers: I32  # (E,) how many layers of the surface end there
    crossings: tuple[I32, I32, I32]  # see the kernel


@record
class Outline:
    """The silhouette of a surface in one view: its directed occluding edges, what they cover, and where that ends."""

    vertex: I32 = array("E", 2, unit="surface vertex index of the two ends of an edge")
    image: F64 = array("E", 2, 2, unit="px, where these project")
    first: I32 = array("H", unit="index of the first span in each row of the image, then how many there are")
    span: I32 = array("S", 2, unit="px, covered in a row: the first column, and the one after the last")
    edge: I32 = array("B", unit="index of the edge that a piece of the boundary belongs to")
    pixel: F64 = array("B", 2, 2, unit="px, the two ends of the piece")


@record
class Projected:
    """A surface projected into one view."""

    image: F64 = array("N", 2, unit="px, NaN behind the camera")
    depth: F64 = array("N", unit="m")
    facing: I8 = array("F", unit="1 faces that look at the camera, -1 away from it, 0 partly behind it")


@memoised
def projected(surface: Surface, camera: Camera) -> Projected:
    """Return where the vertices of a surface project, and which of its faces look at the camera."""
    image, depth = np.empty((len(surface.vertices), 2)), np.empty(len(surface.vertices))
    kernels.project(surface.vertices, projection(camera), image, depth)
    facing = np.empty(len(surface.faces), np.int8)
    kernels.face_directions(image, surface.faces, facing)
    return Projected(image=image, depth=depth, facing=facing)


@memoised
def outline(surface: Surface, camera: Camera) -> Outline:
    """Return the boundary of the silhouette of a surface, parts outside the image included.

    Edges that lie inside the silhouette (a leg before the other) are not part of the boundary.
    """
    return _bounded(_occluding_edges(surface, camera), camera)


@memoised
def skin_outline(surface: Surface, camera: Camera) -> Outline:
    """Return the boundary of the silhouette that the body of a surface has without its cloth."""
    edges = _occluding_edges(surface, camera)
    layers = np.where(surface.layer.take(edges.vertex[:, 0]) == CLOTH, np.int32(0), edges.layers)
    return _bounded(edges._replace(layers=layers), camera)


def covered(surface: Surface, camera: Camera) -> Bool:
    """Return the silhouette of a surface as a mask (H, W)."""
    edges, mask = _occluding_edges(surface, camera), np.zeros((camera.size[1], camera.size[0]), bool)
    first, span = span_kernels.covered(*edges.crossings, edges.layers, camera.size[0])
    span_kernels.fill(first, span, mask)
    return mask


@memoised
def _occluding_edges(surface: Surface, camera: Camera) -> OccludingEdges:
    view = projected(surface, camera)
    vertex, layers = kernels.occluding_edges(surface.edges, view.facing, surface.cloth)
    image = view.image.take(vertex, axis=0)  # several times faster than view.image[vertex]
    image.setflags(write=False)  # as in an `Outline`: kernels are compiled anew for arrays that may be written
    return OccludingEdges(vertex, image, layers, span_kernels.crossings(image, camera.size))


def _bounded(edges: OccludingEdges, camera: Camera) -> Outline:
    first, span = span_kernels.covered(*edges.crossings, edges.layers, camera.size[0])
    edge, pieces = kernels.boundary(edges.image, edges.layers, first, span, PIECE)
    return Outline(vertex=edges.vertex, image=edges.image, first=first, span=span, edge=edge, pixel=pieces)


def distance_to(inside: Bool) -> F32:
    """Return the distance (H, W) px of each pixel's centre to the nearest one inside a mask; 0 there."""
    import cv2

    return np.asarray(cv2.distanceTransform((~inside).view(np.uint8), cv2.DIST_L2, 3), np.float32)


def mask_distance(inside: Bool) -> F32:
    """Return the distance (H, W) px of each pixel's centre to the edge of a mask (H, W), positive inside, not clipped.

    The edge runs half way between the pixels on its two sides; both have to be there.
    """
    import cv2

    within, without = (cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (inside, ~inside))
    return np.where(inside, within - 0.5, 0.5 - without).astype(np.float32)


def intersection_over_union(one: Bool, other: Bool) -> float:
    """Return how well two masks (H, W) agree, 0 to 1; NaN where both are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else float("nan")


def signed_distance(boundary: Outline, camera: Camera, band_px: float) -> F32:
    """Return the distance (H, W) to the boundary in px, exact to the segment, positive inside, clipped to the band."""
    distance = np.full((camera.size[1], camera.size[0]), -band_px, np.float32)
    boundary_kernels.paint_distance(boundary.pixel, boundary.first, boundary.span, np.float32(band_px), distance)
    distance.flags.writeable = False
    return distance


def squared_difference(one: F32, other: F32, band_px: float) -> float:
    """Return the sum of the squared differences of two signed distances (H, W) px, each clipped to the band."""
    columns = np.zeros(one.shape[1], np.float32)
    boundary_kernels.add_squared_difference(one, other, np.float32(band_px), columns)
    return float(columns.sum(dtype=np.float64))


@memoised
def model_distance(surface: Surface, camera: Camera, band_px: float) -> F32:
    """Return the signed distance (H, W) px to the silhouette of a surface, positive inside, clipped to the band."""
    return signed_distance(outline(surface, camera), camera, band_px)


@memoised
def occluding_contour(surface: Surface, camera: Camera, spacing_px: float, skin: bool = False) -> Contour:
    """Return points on the boundary of the silhouette of a surface, or of its body without its cloth; see `samples`."""
    return samples((skin_outline if skin else outline)(surface, camera), surface, camera, spacing_px)


def samples(boundary: Outline, surface: Surface, camera: Camera, spacing_px: float) -> Contour:
    """Return points on the boundary of a silhouette within the image, evenly spaced along it, sorted by row.

    Those at the image border are left out, as in images of the silhouette: there it is cut, not occluding.

    Their normals are the projected surface normals, which look along the image plane at an occluding contour and
    are smoother than the short edges; at cloth, which has a rim, they are those of the edges.
    """
    matrix, cloth = projection(camera), surface.cloth
    points = boundary_kernels.sample(
        boundary.pixel,
        boundary.edge,
        boundary.vertex,
        boundary.image,
        surface.vertices,
        surface.normals,
        cloth,
        matrix,
        camera.size,
        BORDER,
        spacing_px,
    )
    vertex, anchor, pixel, normal = boundary_kernels.in_rows(*points)
    return Contour(vertex=vertex, anchor=anchor, pixel=pixel, normal=normal)
