"""Projection rays as Plücker lines (n, m): every point X on the line satisfies X x n = m."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import centre, directions
from mocapflow.records import F64


def through(pixels: F64, camera: Camera) -> F64:
    """Return the Plücker lines of the projection rays of undistorted pixels.

    Args:
        pixels: (M, 2) px.
        camera: a pinhole camera.

    Returns:
        (M, 6): unit direction n and moment m = centre x n, in m.

    Source: Rosenhahn 2008, Eq. (12.2)
    """
    ray = directions(pixels, camera)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    return np.hstack([ray, np.cross(centre(camera), ray)])


def error(points: F64, lines: F64) -> F64:
    """Return the error vectors X x n - m of points against lines; their norm is the perpendicular distance.

    Args:
        points: (M, 3) m.
        lines: (M, 6).

    Returns:
        (M, 3) m, orthogonal to the lines.

    Source: Rosenhahn 2008, Eq. (12.3)
    """
    return np.cross(points, lines[:, :3]) - lines[:, 3:]
