"""The silhouette of a surface in one view: its boundary, its mask, its signed distance.

The boundary comes from the occluding edges alone: an edge between a face that looks at the camera and one that
looks away, or the rim of an open mesh. Drawn with their direction, these edges say at every pixel how many
front faces cover it (a winding number), so a mask costs a thousand short edges instead of thirty thousand
triangles. Cloth is two-sided: both its sides cover.
"""

from __future__ import annotations

import numpy as np

from mocapflow.data import CLOTH, Camera, Contour, Surface
from mocapflow.geometry import silhouette_kernels as kernels
from mocapflow.geometry.cameras import projection
from mocapflow.records import F32, F64, I32, Bool, array, record

MARGIN = 2  # px around the silhouette, so that the outside of its boundary is seen


@record
class Outline:
    """The boundary of a silhouette in one view, as directed segments, and how often each pixel is covered."""

    vertex: I32 = array("B", 2, unit="surface vertex index of the two ends")
    pixel: F64 = array("B", 2, 2, unit="px, the two ends")
    corner: I32 = array(2, unit="px, column and row of cover[0, 0]")
    cover: I32 = array("H", "W", unit="number of surface layers over each pixel, within the crop")


def outline(surface: Surface, camera: Camera) -> Outline:
    """Return the boundary of the silhouette of a surface, parts outside the image included.

    Edges that lie inside the silhouette (a leg before the other) are not part of the boundary.
    """
    pixels, depth = np.empty((len(surface.vertices), 2)), np.empty(len(surface.vertices))
    kernels.project(surface.vertices, projection(camera), pixels, depth)
    facing = np.empty(len(surface.faces), np.int8)
    kernels.face_directions(pixels, depth, surface.faces, facing)
    segments, times = kernels.occluding_edges(surface.edges, surface.faces, facing, surface.layer == CLOTH)
    ends = pixels[segments]
    width, height = int(camera.size[0]), int(camera.size[1])
    if len(ends):
        low = np.clip(np.floor(ends.reshape(-1, 2).min(0)) - MARGIN, 0, (width, height)).astype(np.int32)
        high = np.clip(np.ceil(ends.reshape(-1, 2).max(0)) + MARGIN + 1, 0, (width, height)).astype(np.int32)
    else:
        low = high = np.zeros(2, np.int32)
    cover = np.zeros((max(high[1] - low[1], 0), max(high[0] - low[0], 0)), np.int32)
    kernels.wind(ends, times, low, cover)
    outer = kernels.on_boundary(ends, low, cover)
    return Outline(vertex=segments[outer], pixel=ends[outer], corner=low, cover=cover)


def mask(boundary: Outline, camera: Camera) -> Bool:
    """Return the silhouette as a mask (H, W)."""
    full = np.zeros((camera.size[1], camera.size[0]), bool)
    (x, y), (h, w) = boundary.corner, boundary.cover.shape
    full[y : y + h, x : x + w] = boundary.cover > 0
    return full


def signed_distance(boundary: Outline, camera: Camera, band_px: float) -> F32:
    """Return the distance (H, W) to the boundary in px, exact to the segment, positive inside, clipped to the band."""
    distance = np.full((camera.size[1], camera.size[0]), -band_px, np.float32)
    kernels.paint_distance(boundary.pixel, boundary.corner, boundary.cover, band_px, distance)
    return distance


def model_distance(surface: Surface, camera: Camera, band_px: float) -> F32:
    """Return the signed distance (H, W) px to the silhouette of a surface, positive inside, clipped to the band."""
    return signed_distance(outline(surface, camera), camera, band_px)


def occluding_contour(surface: Surface, camera: Camera, index: int, normals: F64) -> Contour:
    """Return the vertices on the boundary of the silhouette within the image, with their outward image normals.

    Args:
        surface: the posed surface.
        camera: the view.
        index: the number of the view.
        normals: (N, 3) unit vertex normals of the surface; they look along the image plane at an occluding
            contour, and their projection is smoother than the direction of the short edges.
    """
    boundary = outline(surface, camera)
    vertex, first = np.unique(boundary.vertex[:, 0], return_index=True)
    pixel = boundary.pixel[first, 0]
    inside = ((pixel >= 0) & (pixel <= camera.size - 1)).all(1)
    vertex, pixel, along = vertex[inside], pixel[inside], np.diff(boundary.pixel[first[inside]], axis=1)[:, 0]
    outward = np.column_stack([-along[:, 1], along[:, 0]])
    smooth = _image_normals(normals[vertex], surface.vertices[vertex], camera)
    against = np.sum(smooth * outward, axis=1) < 0
    rim = surface.layer[vertex] == CLOTH  # at a hem the surface normal says nothing about the image normal
    smooth[against & ~rim] *= -1
    smooth[rim] = outward[rim]
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    return Contour(camera=index, vertex=vertex, pixel=pixel, normal=smooth / np.where(length > 0, length, 1.0))


def _image_normals(normals: F64, points: F64, camera: Camera) -> F64:
    """Return how the image of a point moves with its surface normal: (K, 2), not of unit length."""
    matrix = projection(camera)
    homogeneous = points @ matrix[:, :3].T + matrix[:, 3]
    change = normals @ matrix[:, :3].T
    pixel = homogeneous[:, :2] / homogeneous[:, 2:]
    moved: F64 = (change[:, :2] - pixel * change[:, 2:]) / homogeneous[:, 2:]
    return moved
