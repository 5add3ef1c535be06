"""The virtual room: where it is seen from, its floor and cameras, and the person in it."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import PoseBatch, Surface
from mocapflow.geometry import angles, cameras, kinematics
from mocapflow.records import F32, F64, U8
from mocapflow.scene import Scene
from mocapflow_report import drawing, raster

SMOOTH = 2  # pixels are drawn this many times finer, then averaged
FIELD_OF_VIEW = 42.0  # deg
SKIN = np.array([0.80, 0.82, 0.84])  # BGR
GARMENT = np.array([0.80, 0.42, 0.22])
STICK: drawing.Colour = (70, 105, 20)
FRUSTUM: drawing.Colour = (150, 90, 30)
STAND: drawing.Colour = (190, 185, 180)
FLOOR, WALL = np.array([0.86, 0.85, 0.83]), np.array([0.97, 0.955, 0.94])
BESIDE = 1.0  # m, from the body to its stick model
TILE = 0.5  # m
DEPTH = 0.45  # m from a camera to the end of the pyramid that is drawn for it
ASIDE = (32.0, -32.0, 45.0, -45.0, 20.0, -20.0, 60.0, -60.0)  # deg from straight before the person


class Room:
    """Draws a person in motion from one place, in front of the person, a little to the side and above.

    Args:
        scene: the person and the cameras.
        poses: of the motion, T of them: all of it is in the picture.
        size: of a picture, width and height in px.
    """

    def __init__(self, scene: Scene, poses: PoseBatch, size: tuple[int, int]) -> None:
        self._scene, body = scene, scene.body
        places = kinematics.joint_centres(body, poses.root, poses.angles)
        skin = body.positions[:, 2].min() - body.vertices[:, 2].min()  # below the lowest joint, whichever that is
        height = float(np.median(places[..., 2].min(axis=1)) - skin)
        self._floor = 0.0 if abs(height) < 0.2 else height  # the world's floor, unless the person stands elsewhere
        self._camera = self._place(places[:, 0], poses.root[0, :3, :3], (SMOOTH * size[0], SMOOTH * size[1]))
        self._side = BESIDE * self._camera.camera_from_world[0, :3]
        self._empty = self._backdrop()

    def picture(self, body: Surface, cloth: F64) -> U8:
        """Return the image (H, W, 3) BGR of a posed body and cloth vertices (W, 3)."""
        import cv2

        canvas = raster.Canvas(self._shadowed(body), self._camera)
        draw_person(canvas, self._scene, body.vertices, cloth, opacity=0.55)
        image = np.clip(255 * canvas.picture, 0, 255).astype(np.uint8)
        self._stick(image, body)
        return np.asarray(cv2.resize(image, None, fx=1 / SMOOTH, fy=1 / SMOOTH, interpolation=cv2.INTER_AREA), np.uint8)

    def _place(self, roots: F64, rotation: F64, size: tuple[int, int]) -> Camera:
        """Return the view from before the person, of several the one that sees most cameras."""
        forward = rotation @ angles.anatomical_axes(self._scene.body)[0]
        ahead = np.arctan2(forward[1], forward[0])
        views = [self._view(roots, ahead + np.radians(aside), size) for aside in ASIDE]
        return max(views, key=self._cameras_seen)  # the first of equals

    def _view(self, roots: F64, bearing: float, size: tuple[int, int]) -> Camera:
        """Return a view from a bearing, far enough for the person, all their ways and the stick model."""
        low, high = roots.min(0), roots.max(0)
        tall = float(np.ptp(self._scene.body.vertices[:, 2]))
        width = float(np.linalg.norm((high - low)[:2])) + BESIDE + 0.9
        reach = max(1.5 * tall, width * size[1] / size[0])
        distance = 1.1 * reach / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
        away = np.array([np.cos(bearing), np.sin(bearing), 0.32])
        right = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
        target = np.append((low + high)[:2] / 2, self._floor + 0.58 * tall) + BESIDE / 2 * right
        return raster.look_at(target + distance * away, target, size, FIELD_OF_VIEW)

    def _cameras_seen(self, view: Camera) -> int:
        centres = np.array([cameras.centre(camera) for camera in self._scene.cameras])
        pixels = cameras.project(centres, view)
        return int(((pixels > 0) & (pixels < view.size)).all(axis=1).sum())

    def _backdrop(self) -> F32:
        """Return the empty room: tiles that fade into the distance, and the cameras."""
        points = raster.floor_points(self._camera, self._floor)
        tiles = np.floor(points / TILE)
        dark = np.where(np.nan_to_num(tiles.sum(-1)) % 2 == 1, 0.92, 1.0)
        away = np.linalg.norm(points - cameras.centre(self._camera)[:2], axis=-1)
        near = np.exp(-((np.nan_to_num(away, nan=1e3) / 9.0) ** 2))[..., None]
        picture = near * FLOOR * dark[..., None] + (1 - near) * WALL
        image = np.clip(255 * picture, 0, 255).astype(np.uint8)
        for camera in self._scene.cameras:
            pixels = cameras.project(_frustum(camera, self._floor), self._camera)
            ends = np.stack([pixels[[0, 0, 0, 0, 1, 2, 3, 4]], pixels[[1, 2, 3, 4, 2, 3, 4, 1]]], axis=1)
            drawing.segments(image, pixels[[0, 5]][None], STAND, SMOOTH)
            drawing.segments(image, ends, FRUSTUM, SMOOTH)
        return np.asarray(image / 255.0, np.float32)

    def _shadowed(self, body: Surface) -> F32:
        """Return the empty room with the soft shadow of the body on the floor."""
        import cv2

        drop = (body.vertices[:, 2:] - self._floor) / raster.LIGHT[2]
        flat = body.vertices - 0.6 * drop * raster.LIGHT  # a steeper lamp than the one that shades: a smaller shadow
        flat[:, 2] = self._floor
        shadow = raster.Canvas(np.zeros_like(self._empty), self._camera)
        shadow.draw(flat, body.faces, np.ones(flat.shape, np.float32))
        box = shadow.box(flat, margin=16 * SMOOTH)
        soft = cv2.GaussianBlur(np.ascontiguousarray(shadow.picture[box][..., 0]), (0, 0), 4.0 * SMOOTH)
        shaded = self._empty.copy()
        shaded[box] *= 1 - np.float32(0.28) * soft[..., None]
        return shaded

    def _stick(self, image: U8, body: Surface) -> None:
        """Draw the skeleton beside the body."""
        places = kinematics.joint_positions(self._scene.body, body.joints) + self._side
        pixels = cameras.project(places, self._camera)
        drawing.segments(image, drawing.bones(self._scene.body.parents, pixels), STICK, 3 * SMOOTH)
        drawing.dots(image, pixels, (40, 40, 200), 3.5 * SMOOTH)


def draw_person(canvas: raster.Canvas, scene: Scene, skin: F64, cloth: F64, opacity: float) -> None:
    """Draw the body (V, 3) m of a scene and its garment (W, 3) m, which lets it shine through; empty: no garment."""
    canvas.draw(skin, scene.body.faces, raster.shade(skin, scene.body.faces, SKIN))
    if scene.garment is not None and len(cloth):
        faces = scene.garment.faces
        canvas.veil(cloth, faces, raster.shade(cloth, faces, GARMENT, two_sided=True), opacity)


def _frustum(camera: Camera, floor: float) -> F64:
    """Return the centre of a camera, the corners of what it sees at a depth, and the floor below it: (6, 3) m."""
    width, height = camera.size
    rays = cameras.directions(np.array([[0, 0], [width, 0], [width, height], [0, height]], float), camera)
    centre = cameras.centre(camera)
    return np.vstack([centre, centre + DEPTH * rays, [*centre[:2], floor]])
