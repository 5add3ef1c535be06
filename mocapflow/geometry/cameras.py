"""Pinhole projection, and removing lens distortion once, when data enter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocapflow.data import Camera
from mocapflow.records import F64


def projection(camera: Camera) -> F64:
    """Return the 3 x 4 matrix that maps world points (m) to homogeneous pixels of an undistorted view."""
    return camera.intrinsics @ camera.camera_from_world[:3]


def project(points: F64, camera: Camera) -> F64:
    """Return undistorted pixels (M, 2) of world points (M, 3) in m; NaN for points behind the camera."""
    matrix = projection(camera)
    homogeneous = points @ matrix[:, :3].T + matrix[:, 3]
    depth = np.where(homogeneous[:, 2:] > 0, homogeneous[:, 2:], np.nan)
    pixels: F64 = homogeneous[:, :2] / depth
    return pixels


def centre(camera: Camera) -> F64:
    """Return the projection centre (3,) in m."""
    position: F64 = -camera.camera_from_world[:3, :3].T @ camera.camera_from_world[:3, 3]
    return position


def pinhole(camera: Camera) -> Camera:
    """Return the same camera without lens distortion: the camera of an undistorted image."""
    return replace(camera, distortion=np.zeros(5), fisheye=False)


def scaled(camera: Camera, factor: float) -> Camera:
    """Return the camera of an image resized by a factor (pixel centres stay on integers)."""
    scale = np.array([[factor, 0, (factor - 1) / 2], [0, factor, (factor - 1) / 2], [0, 0, 1.0]])
    size = np.round(camera.size * factor).astype(np.int32)
    return replace(camera, intrinsics=scale @ camera.intrinsics, size=size)


def undistort(pixels: F64, camera: Camera) -> F64:
    """Return pixels (M, 2) with the lens distortion of the camera removed."""
    import cv2

    if not len(pixels) or not camera.distortion.any():
        return pixels
    points = np.ascontiguousarray(pixels, np.float64)[:, None]
    k = np.asarray(camera.intrinsics)
    if camera.fisheye:
        undistorted = cv2.fisheye.undistortPoints(points, k, camera.distortion[:4], P=k)
    else:
        many = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
        undistorted = cv2.undistortPointsIter(points, k, camera.distortion, np.eye(3), k, many)
    return np.asarray(undistorted, np.float64)[:, 0]


def distort(pixels: F64, camera: Camera) -> F64:
    """Return undistorted pixels (M, 2) as the lens of the camera shows them."""
    import cv2

    if not len(pixels) or not camera.distortion.any():
        return pixels
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.intrinsics).T
    zero = np.zeros(3)
    if camera.fisheye:
        distorted, _ = cv2.fisheye.projectPoints(
            rays[:, None], zero, zero, camera.intrinsics, camera.distortion[:4]
        )
    else:
        distorted, _ = cv2.projectPoints(rays[:, None], zero, zero, camera.intrinsics, camera.distortion)
    return np.asarray(distorted, np.float64)[:, 0]
