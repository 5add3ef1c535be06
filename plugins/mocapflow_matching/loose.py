"""Clothes that no garment models: an arm before a skirt must not take the skirt's edge for its own."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Body, Camera
from mocapflow.data import Silhouette, Surface
from mocapflow.geometry.cameras import magnification, project
from mocapflow.geometry.contours import at_nearest
from mocapflow.geometry.kinematics import descendants
from mocapflow.once import once
from mocapflow.records import F32, F64, I32, Bool
from mocapflow.scene import Scene

CELL = 4  # px of the image in which trunk and legs are drawn, and of a step inward
FILLED = np.ones((3, 3), np.uint8)  # cells by a vertex


def stands_off(
    pixel: F64, normal: F64, vertex: I32, silhouette: Silhouette, surface: Surface, scene: Scene, loose_m: float
) -> F64:
    """Return the standard deviation (M,) px that clothes add to pairs of image points and vertices.

    An arm's vertex is paired with what may be the edge of clothes on trunk or legs where these come within reach,
    going inward from the image point, and no background before them: an arm that is seen apart is known by the gap.
    The edge stands off alike along the arm, so its many points are one measurement, and each is given the whole reach.

    Args:
        pixel: (M, 2) px, points of the image contour.
        normal: (M, 2) there, out of the silhouette.
        vertex: (M,) that they are paired with.
        silhouette: the person in this view.
        surface: the posed body.
        scene: the cameras, and the body that knows its arms.
        loose_m: how far clothes may stand off.
    """
    camera, arm = scene.cameras[silhouette.camera], on_arm(scene.body)
    rows = np.flatnonzero(arm.take(vertex, mode="clip") & (vertex < len(arm)))
    reach = loose_m * magnification(camera, surface.vertices.mean(axis=0))
    near = _drawn(surface.vertices[: len(arm)][~arm], camera)
    reached, left = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
    for way in np.arange(CELL, reach + CELL, CELL):
        inward = pixel.take(rows, axis=0) - way * normal.take(rows, axis=0)
        left |= at_nearest(silhouette.distance, inward) <= 0
        reached |= ~left & (at_nearest(near, inward / CELL) > 0)
    off = np.zeros(len(vertex))
    off[rows[reached]] = reach
    return off


@once
def on_arm(body: Body) -> Bool:
    """Return which vertices (V,) move most with a shoulder or what hangs from it; none where no joint is so called."""
    carrier = body.skin_joint[np.arange(len(body.vertices)), body.skin_weight.argmax(axis=1)]
    shoulders = [joint for joint, name in enumerate(body.joint_names) if name.startswith("shoulder")]
    arm: Bool = np.any(descendants(body.parents)[shoulders], axis=0)[carrier]
    return arm


def _drawn(points: F64, camera: Camera) -> F32:
    """Return an image of a view, at one over CELL of its size, that is 1 around points (K, 3) m and 0 elsewhere."""
    import cv2

    drawn = np.zeros(camera.size[::-1] // CELL + 1, np.float32)
    place = np.rint(project(points, camera) / CELL)
    column, row = place[((place >= 0) & (place < drawn.shape[::-1])).all(axis=1)].astype(np.int32).T
    drawn[row, column] = 1
    return np.asarray(cv2.dilate(drawn, FILLED), np.float32)
