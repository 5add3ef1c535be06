"""Pinhole projection, and removing lens distortion once, when data enter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.memo import memoised
from mocapflow.records import F64, I16

UNDISTORT_STEPS = 100
UNDISTORT_TOLERANCE = 1e-12  # of the focal length
UNDISTORT_OFF = 0.1  # px; a pixel that is found is shown nearer than this to where it was


@memoised
def projection(camera: Camera) -> F64:
    """Return the 3 x 4 matrix that maps world points (m) to homogeneous pixels of an undistorted view."""
    return camera.intrinsics @ camera.camera_from_world[:3]


def projections(cameras: Sequence[Camera]) -> F64:
    """Return the matrices (C, 3, 4) that map world points (m) to homogeneous pixels of undistorted views."""
    return np.array([projection(camera) for camera in cameras]).reshape(-1, 3, 4)


def project(points: F64, camera: Camera) -> F64:
    """Return undistorted pixels (M, 2) of world points (M, 3) in m; NaN for points behind the camera."""
    matrix = projection(camera)
    return _divided(points @ matrix[:, :3].T + matrix[:, 3])


def project_each(points: F64, view: I16, cameras: Sequence[Camera]) -> F64:
    """Return undistorted pixels (M, 2) of world points (M, 3) in m, each in its own view (M,)."""
    matrix = projections(cameras).take(view, axis=0)
    return _divided(np.einsum("mab,mb->ma", matrix[..., :3], points) + matrix[..., 3])


def _divided(homogeneous: F64) -> F64:
    """Return the pixels (M, 2) of homogeneous ones (M, 3); NaN for those behind the camera."""
    return homogeneous[:, :2] / np.where(homogeneous[:, 2:] > 0, homogeneous[:, 2:], np.nan)


def centre(camera: Camera) -> F64:
    """Return the projection centre (3,) in m."""
    return -camera.camera_from_world[:3, :3].T @ camera.camera_from_world[:3, 3]


def directions(pixels: F64, camera: Camera) -> F64:
    """Return the rays (..., 3) of pixels (..., 2) of a pinhole camera, in the world and one metre deep."""
    homogeneous = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
    rays: F64 = homogeneous @ np.linalg.inv(camera.intrinsics).T @ camera.camera_from_world[:3, :3]
    return rays


def magnification(camera: Camera, point: F64) -> float:
    """Return how large a view shows what stands at a point (3,) in m: px per metre across the line of sight."""
    depth = camera.camera_from_world[2, :3] @ point + camera.camera_from_world[2, 3]
    return float(camera.intrinsics[0, 0] / depth)


def pinhole(camera: Camera) -> Camera:
    """Return the same camera without lens distortion: the camera of an undistorted image."""
    return replace(camera, distortion=np.zeros(5), fisheye=False)


def scaled(camera: Camera, factor: float) -> Camera:
    """Return the camera of an image resized by a factor (pixel centres stay on integers)."""
    size = np.round(camera.size * factor).astype(np.int32)
    fx, fy = size / camera.size  # not quite the factor where the size had to be rounded
    scale = np.array([[fx, 0, (fx - 1) / 2], [0, fy, (fy - 1) / 2], [0, 0, 1.0]])
    return replace(camera, intrinsics=scale @ camera.intrinsics, size=size)


def shrunk(camera: Camera, factor: int) -> Camera:
    """Return a camera whose pixels are the means of squares of another's; what is left over is dropped."""
    return scaled(replace(camera, size=camera.size // factor * factor), 1 / factor)


def bends(camera: Camera) -> bool:
    """Tell whether the lens shows anything but a pinhole image; a fisheye does without any coefficient."""
    return camera.fisheye or bool(camera.distortion.any())


def undistort(pixels: F64, camera: Camera) -> F64:
    """Return pixels (M, 2) with the lens distortion of the camera removed; NaN where its model shows no such pixel."""
    if not len(pixels) or not bends(camera):
        return pixels
    ideal = _undistort_fisheye(pixels, camera) if camera.fisheye else _undistort_radial(pixels, camera)
    off = np.linalg.norm(distort(ideal, camera) - pixels, axis=1)
    ideal[~(off < UNDISTORT_OFF)] = np.nan  # beyond where the model turns back, or 90 degrees off the axis
    return ideal


def _undistort_fisheye(pixels: F64, camera: Camera) -> F64:
    import cv2

    k = np.asarray(camera.intrinsics)
    points = np.ascontiguousarray(pixels, np.float64)[:, None]
    return np.asarray(cv2.fisheye.undistortPoints(points, k, camera.distortion[:4], P=k), np.float64)[:, 0]


def _undistort_radial(pixels: F64, camera: Camera) -> F64:
    """Invert OpenCV's model by fixed-point iteration (OpenCV itself stops too early, or renames the function)."""
    k1, k2, p1, p2, k3 = camera.distortion
    homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
    seen = (homogeneous @ np.linalg.inv(camera.intrinsics).T)[:, :2]
    x, y = seen.T.copy()
    for _ in range(UNDISTORT_STEPS):
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        new_x = (seen[:, 0] - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial
        new_y = (seen[:, 1] - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial
        moved = max(np.abs(new_x - x).max(), np.abs(new_y - y).max())
        x, y = new_x, new_y
        if moved < UNDISTORT_TOLERANCE:
            break
    return (np.column_stack([x, y, np.ones(len(x))]) @ camera.intrinsics.T)[:, :2]


def distort(pixels: F64, camera: Camera) -> F64:
    """Return undistorted pixels (M, 2) as the lens of the camera shows them."""
    import cv2

    if not len(pixels) or not bends(camera):
        return pixels
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.intrinsics).T
    zero = np.zeros(3)
    if camera.fisheye:
        distorted, _ = cv2.fisheye.projectPoints(rays[:, None], zero, zero, camera.intrinsics, camera.distortion[:4])
    else:
        distorted, _ = cv2.projectPoints(rays[:, None], zero, zero, camera.intrinsics, camera.distortion)
    return np.asarray(distorted, np.float64)[:, 0]
