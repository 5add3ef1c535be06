"""The cameras of the tiny scene and the empty room they see."""

from __future__ import annotations

from functools import cache

import numpy as np

from mocapflow.assets import Camera
from mocapflow.records import F64

SIZE = (320, 240)  # px


@cache
def room(camera: int) -> F64:
    """Return the empty room (240, 320, 3): a soft pattern, another one in each view; it can't be written to."""
    row, column = np.mgrid[: SIZE[1], : SIZE[0]]
    pattern: F64 = 90 + 15 * np.sin(row / 23 + camera)[..., None] + 10 * np.cos(column / 17)[..., None] * [1, 0.5, 0.2]
    pattern.setflags(write=False)
    return pattern


def tiny_camera(index: int, azimuth: float) -> Camera:
    """Return a pinhole camera 3 m from the tiny body, at an azimuth in rad."""
    target = np.array([0.0, 0.0, 0.65])
    forward = -np.array([np.cos(azimuth), np.sin(azimuth), 0.1])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    camera_from_world[:3, 3] = -camera_from_world[:3, :3] @ (target - 3 * forward)
    return Camera(
        name=f"cam{index + 1:02}",
        size=np.array(SIZE, np.int32),
        intrinsics=np.array([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]]),
        distortion=np.zeros(5),
        camera_from_world=camera_from_world,
    )
