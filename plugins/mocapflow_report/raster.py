"""Shaded triangles through a virtual camera, on the processor alone (OpenCV's rasteriser)."""

from __future__ import annotations

from typing import Any

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry import cameras, meshes
from mocapflow.records import F32, F64, I32

NEAR, FAR = 0.1, 200.0  # m
LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
SKY = 0.42  # share of the light that comes from all of the sky
CUT = 0.03  # m by which the wide triangles of a cloth may cut through the round body they lie on


def look_at(place: F64, target: F64, size: tuple[int, int], field_of_view_deg: float) -> Camera:
    """Return a pinhole camera at a place (3,) m that looks at a target (3,), upright; the field of view is vertical."""
    forward = (target - place) / np.linalg.norm(target - place)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = -pose[:3, :3] @ place
    focal = size[1] / 2 / np.tan(np.radians(field_of_view_deg) / 2)
    intrinsics = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    pixels = np.array(size, np.int32)
    return Camera(name="view", size=pixels, intrinsics=intrinsics, distortion=np.zeros(5), camera_from_world=pose)


def shade(vertices: F64, faces: I32, colour: F64, two_sided: bool = False) -> F32:
    """Return the colour of each vertex (N, 3), 0 to 1, lit by a sky and one lamp."""
    facing = meshes.vertex_normals(vertices, faces) @ LIGHT
    lamp = np.abs(facing) if two_sided else np.clip(facing, 0, 1)
    sky = SKY * (0.75 + 0.25 * np.abs(facing))
    return np.asarray((sky + (1 - SKY) * lamp)[:, None] * colour, np.float32)


class Canvas:
    """A colour and a depth buffer that triangles are drawn into."""

    def __init__(self, picture: F32, camera: Camera) -> None:
        self.picture = np.ascontiguousarray(picture, np.float32)
        self.depth = np.full(picture.shape[:2], FAR, np.float32)
        self._camera = camera

    def draw(self, vertices: F64, faces: I32, colours: F32) -> None:
        """Draw triangles with one colour per vertex, nearest on top; both sides are seen."""
        import cv2

        picture, depth = cv2.triangleRasterize(
            np.asarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32), colours,
            self.picture, self.depth, self._opengl_pose(), self._field_of_view(), NEAR, FAR, _settings(),
        )  # fmt: skip
        self.picture, self.depth = np.asarray(picture, np.float32), np.asarray(depth, np.float32)

    def veil(self, vertices: F64, faces: I32, colours: F32, opacity: float) -> None:
        """Draw the nearest layer of triangles, which let shine through what is behind, or up to `CUT` before them."""
        box = self.box(vertices)
        behind, depth = self.picture[box].copy(), self.depth[box].copy()
        reach = np.minimum(depth + np.float32(CUT), np.float32(FAR))
        self.depth[box] = reach
        self.draw(vertices, faces, colours)
        covered = self.depth[box] < reach
        self.depth[box] = np.minimum(self.depth[box], depth)
        mixed = np.float32(opacity) * self.picture[box] + np.float32(1 - opacity) * behind
        np.copyto(self.picture[box], mixed, where=covered[..., None])

    def box(self, vertices: F64, margin: int = 1) -> tuple[slice, slice]:
        """Return the rows and columns of the pixels that triangles may cover, and a margin; most of a room is empty."""
        pixels = cameras.project(vertices, self._camera)
        if np.isnan(pixels).any():  # behind the camera
            return slice(None), slice(None)
        low, high = np.clip([pixels.min(0) - margin, pixels.max(0) + margin + 1], 0, self._camera.size).astype(int)
        return slice(low[1], high[1]), slice(low[0], high[0])

    def _field_of_view(self) -> float:
        return float(2 * np.arctan(self._camera.size[1] / 2 / self._camera.intrinsics[1, 1]))

    def _opengl_pose(self) -> F64:
        """Return camera_from_world with y up and z backwards."""
        return np.diag([1.0, -1.0, -1.0, 1.0]) @ self._camera.camera_from_world


def floor_points(camera: Camera, height: float) -> F64:
    """Return where the ray of each pixel meets the floor: (H, W, 2) m, NaN above the horizon."""
    width, rows = int(camera.size[0]), int(camera.size[1])
    u, v = np.meshgrid(np.arange(width), np.arange(rows))
    rays = cameras.directions(np.stack([u, v], -1).astype(float), camera)
    place = cameras.centre(camera)
    down = np.where(rays[..., 2] < -1e-3, rays[..., 2], np.nan)
    points: F64 = place[:2] + ((height - place[2]) / down)[..., None] * rays[..., :2]
    return points


def _settings() -> Any:
    import cv2

    return (
        cv2.TriangleRasterizeSettings()
        .setCullingMode(cv2.RASTERIZE_CULLING_NONE)
        .setShadingType(cv2.RASTERIZE_SHADING_SHADED)
    )
