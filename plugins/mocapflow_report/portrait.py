"""Pictures for people: a posed body in its garment on a plain ground, and a garment's pattern with its measures."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from mocapflow.assets import Camera, GarmentMesh
from mocapflow.data import Pose
from mocapflow.geometry import kinematics, meshes
from mocapflow.geometry.angles import anatomical_axes
from mocapflow.records import F64, U8
from mocapflow.scene import Scene
from mocapflow_report import drawing, raster
from mocapflow_report.room import SMOOTH, WALL, draw_person

FIELD_OF_VIEW = 18.0  # deg
HEAD_ROOM = 1.15  # height of the picture over the person's
SIZE = (300, 460)  # px
BESIDE = 0.15  # m between two pieces of a pattern
INK: drawing.Colour = (120, 60, 30)


def portrait(
    scene: Scene,
    pose: Pose,
    cloth: F64,
    *,
    bearing_deg: float = 40.0,
    size: tuple[int, int] = SIZE,
    opacity: float = 1.0,
    above: float = 0.08,
) -> U8:
    """Return the image (H, W, 3) BGR of a person in a pose, dressed or not.

    Args:
        scene: whose body and garment.
        pose: of the body.
        cloth: (W, 3) m, the garment in the world; empty for the bare body.
        bearing_deg: where it is seen from: 0 the front, 90 the person's left.
        size: width and height in px.
        opacity: of the garment.
        above: how far above the level of the person's middle it is seen from, over the distance.
    """
    import cv2

    skin = kinematics.skin(scene.body, kinematics.chain(scene.body, pose)[0], pose.angles)
    camera = _before(scene, pose, np.radians(bearing_deg), above, (SMOOTH * size[0], SMOOTH * size[1]))
    canvas = raster.Canvas(np.full((SMOOTH * size[1], SMOOTH * size[0], 3), WALL, np.float32), camera)
    draw_person(canvas, scene, skin, cloth, opacity)
    fine = np.clip(255 * canvas.picture, 0, 255).astype(np.uint8)
    return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.uint8)


def pattern(garment: GarmentMesh) -> U8:
    """Return the image (H, W, 3) BGR of a garment laid flat: each row as long as it is around, at its depth."""
    width, height = SIZE
    image = np.full((height, width, 3), np.round(255 * WALL), np.uint8)
    depth = float(meshes.lengths_along(garment.vertices, garment.strands).max())
    drawing.label(image, f"{depth:.2f} m along the cloth", line=1)
    if not len(garment.rings):  # strands alone have no width
        return image
    rows = _rows(garment)
    half = max(reach for _, _, reach in rows)
    scale = min(0.8 * width / (2 * half), 0.7 * height / depth)
    origin = np.array([width / 2, 0.2 * height])
    ends = np.array([[[left, below], [right, below]] for below, left, right in rows])
    drawing.segments(image, ends * scale + origin, INK)
    for (below, left, right), shift in ((rows[0], -8), (rows[-1], 20)):
        x, y = origin + scale * np.array([(left + right) / 2, below])
        drawing.note(image, f"{right - left:.2f} m", (x - 22, y + shift))
    return image


def _rows(garment: GarmentMesh) -> list[tuple[float, float, float]]:
    """Return depth, left and right end (m) of each row of links; rows of one depth lie side by side."""
    a, b = garment.rings.T
    count = len(garment.vertices)
    _, piece = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count)), directed=False)
    depth = meshes.lengths_along(garment.vertices, garment.strands)
    used = np.unique(piece[a])
    around = np.bincount(piece[a], garment.ring_length, count)[used]
    below = np.array([depth[piece == k].max() for k in used]).round(3)
    across = np.array([garment.vertices[piece == k, 0].mean() for k in used])
    rows = []
    for level in np.unique(below):
        beside = sorted(np.flatnonzero(below == level), key=lambda k: across[k])
        left = -(around[beside].sum() + BESIDE * (len(beside) - 1)) / 2
        for k in beside:
            rows.append((float(level), float(left), float(left + around[k])))
            left += around[k] + BESIDE
    return rows


def _before(scene: Scene, pose: Pose, bearing: float, above: float, size: tuple[int, int]) -> Camera:
    """Return a view of the whole person at rest, from a bearing about the body's own up."""
    forward, up, right = anatomical_axes(scene.body) @ pose.root[:3, :3].T
    low, high = scene.body.vertices[:, 2].min(), scene.body.vertices[:, 2].max()
    middle = np.array([*scene.body.positions[0, :2], (low + high) / 2])
    target = pose.root[:3, :3] @ middle + pose.root[:3, 3]
    distance = HEAD_ROOM * (high - low) / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
    away = np.cos(bearing) * forward - np.sin(bearing) * right + above * up
    return raster.look_at(target + distance * away, target, size, FIELD_OF_VIEW)
