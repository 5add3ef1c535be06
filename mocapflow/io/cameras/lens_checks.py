"""Whether a lens can have the numbers of a calibration, once the size of its pictures is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import distort, undistort
from mocapflow.io.cameras.from_numbers import bad
from mocapflow.records import F64

SHORT = 0.1  # focal length by the longer side of the picture; with less, a pinhole would see more than 157 degrees
ASKEW = 0.01  # of the longer side, by which tangential terms may move a pixel; those of a good lens do by 0.002
FOLDED = 0.05  # share of the undistorted picture, beyond which the lens' model is none of this lens
UNFOLDED = 1.0  # px; a pixel that is shown once is found again nearer than this
RAYS = 9  # per side of a picture
ORDER = "the order is k1 k2 p1 p2 k3, a fisheye has k1 k2 k3 k4 and fisheye = true"


def check_focal_length(camera: Camera, calibration: Path) -> None:
    """Check that a camera's focal length is in pixels.

    Raises:
        RecordingError: with it, one would look sideways.
    """
    focal, side = float(camera.intrinsics[[0, 1], [0, 1]].min()), int(camera.size.max())
    if focal < SHORT * side:
        hint = "matrix is in pixels: take millimetres times the picture's width in px over the sensor's in mm"
        raise bad(camera.name, calibration, f"has a focal length of {focal:g} px in pictures of {side}", hint)


def odd_lens(camera: Camera) -> Iterator[str]:
    """Say what a lens hardly has: its axis beside the picture, or a distortion that is none."""
    centre = camera.intrinsics[:2, 2]
    if (centre <= 0).any() or (centre >= camera.size - 1).any():
        size = f"{camera.size[0]} x {camera.size[1]} px"
        yield f"{camera.name}: its principal point ({centre[0]:g}, {centre[1]:g}) is not in its pictures of {size}"
    if camera.fisheye or not camera.distortion.any():
        return
    pixels: F64 = np.stack(np.meshgrid(*(np.linspace(0, n - 1, RAYS) for n in camera.size)), -1).reshape(-1, 2)
    tangential = replace(camera, distortion=camera.distortion * [0, 0, 1, 1, 0])
    moved = float(np.linalg.norm(distort(pixels, tangential) - pixels, axis=1).max())
    if moved > ASKEW * camera.size.max():
        yield f"{camera.name}: its tangential distortion moves pixels by {moved:.0f} px, much for a lens; {ORDER}"
    off = np.linalg.norm(undistort(distort(pixels, camera), camera) - pixels, axis=1)
    folded = float(np.mean(~(off < UNFOLDED)))  # NaN, too
    if folded > FOLDED:
        yield f"{camera.name}: its distortion folds {folded:.0%} of the undistorted picture, as no lens does; {ORDER}"
