"""How sure the angles of a track are: the deviations of the fit, made as large as its errors are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry import angles
from mocapflow.geometry.cameras import magnification
from mocapflow.geometry.kinematics import root_position
from mocapflow.records import F64
from mocapflow.results import Track
from mocapflow.scene import Scene

OUTLINE_MM = 1.5  # benchmarks/calibrate_uncertainty.py on rendered takes; how it holds: docs/results/uncertainty.md
DOUBTED = 3.0  # times less sure is a fit that the images contradict: 90 % of the errors of 28 such lie within 3.15


def measured(track: Track, scene: Scene) -> angles.AngleSeries:
    """Return the angles of a track, their calibrated standard deviations, and what was seen of them.

    The covariance of a track is that of the normal equations: what noise of the residuals' size does that hangs
    together over 15 px of a contour. `smooth` weighs by it as it is: what neighbouring frames have in common does not
    average out, so it is no reason to hold a frame less. Nor does it weigh doubted frames less: in the one take
    that has many they come in a row, in the midst of a kick, which it would take away.
    """
    series = angles.measure(scene.body, track.root, track.angles, track.covariance, track.observed)
    pelvis = root_position(scene.body, track.root)
    scale = excess(px_per_mm(pelvis, scene.cameras), OUTLINE_MM) * np.where(track.doubted, DOUBTED, 1.0)
    return replace(series, sd=scale[:, None] * series.sd)


def excess(size: F64, outline_mm: float) -> F64:
    """Return by how much errors exceed those of noise in pixels, where images show a person `size` (T,) px per mm.

    An outline is off by a pixel and, however large the image, by some millimetres: shadows, socks before a light floor,
    cloth and skin that are not quite the model's. They err alike along whole limbs and for a third of a second.
    """
    return 1.0 + outline_mm * size


def px_per_mm(places: F64, cameras: Sequence[Camera]) -> F64:
    """Return how large the images show what stands at places (T, 3) in m: (T,), the median of the views."""
    sizes = [[magnification(camera, place) for camera in cameras] for place in places]
    return np.asarray(np.median(sizes, axis=1) / 1000)
