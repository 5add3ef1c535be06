"""Epipolar planes, through the centres of two cameras: what both see lies in the same one, in either view.

The angle of its plane is thus a number that two views agree on at every moment, for a point (a keypoint) as for the
outermost planes that touch a silhouette (its epipolar tangents; Sinha and Pollefeys, "Synchronization and calibration
of camera networks from silhouettes", ICPR 2004).
"""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import centre, directions
from mocapflow.records import F64


def plane_angles(pixels: F64, camera: Camera, axes: F64) -> F64:
    """Return the angles (...) rad of the planes in which pixels (..., 2) of a camera lie.

    Args:
        pixels: of a pinhole camera.
        camera: one of the two cameras of `axes`.
        axes: (2, 3) from `pencil_axes`.
    """
    rays = directions(pixels, camera)
    angles: F64 = np.arctan2(rays @ axes[1], rays @ axes[0])
    return angles


def pencil_axes(one: Camera, other: Camera) -> F64:
    """Return two unit vectors (2, 3) across the line through two cameras; angle zero is where the cameras look."""
    line = centre(other) - centre(one)
    line /= np.linalg.norm(line)
    ahead = one.camera_from_world[2, :3] + other.camera_from_world[2, :3]
    if np.linalg.norm(np.cross(line, ahead)) < 0.1:  # they face each other: any direction will do
        ahead = one.camera_from_world[1, :3]
    first = ahead - line * (line @ ahead)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(line, first)])
