"""How sure the angles of a track are: the deviations of the fit, made as large as its errors are."""

from __future__ import annotations

from dataclasses import replace

from mocapflow.geometry import angles
from mocapflow.results import Track
from mocapflow.scene import Scene

FACTOR = 2.14  # benchmarks/calibrate_uncertainty.py on six rendered takes; docs/results.md says how it holds on others


def measured(track: Track, scene: Scene) -> angles.AngleSeries:
    """Return the angles of a track, their calibrated standard deviations, and what was seen of them.

    The covariance of a track is that of the normal equations: what noise does that hangs together over 15 px of a
    contour. Errors hang together over whole limbs and sheets of cloth, and for a third of a second; how much larger
    that makes them is measured, one factor for all. `smooth` weighs by the covariance as it is: what neighbouring
    frames have in common does not average out, so it is no reason to hold a frame less.
    """
    series = angles.measure(scene.body, track.root, track.angles, track.covariance, track.observed)
    return replace(series, sd=FACTOR * series.sd)
