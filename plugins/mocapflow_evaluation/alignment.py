"""Two recordings of one motion brought to the same times, and by how much one comes later or counts the other way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mocapflow.records import F64
from mocapflow_evaluation.compare import turning_point
from mocapflow_evaluation.references import SLACK, Reference

GAP = 1.5  # samples; across a longer one nothing is interpolated
FEWEST = 10  # frames that both must have; fewer are alike, or opposed, by chance
LEAST = 0.5  # of our frames must have a counterpart at every shift that is tried
HALF = 0.5  # frames; a smaller lag is lost in the resampling, and times that differ less are the same
LIKE = 0.5  # correlation below which two systems show no common lag
GAIN = 0.2  # of what is unlike without a lag; a lag that explains less may be chance
TURNED = -0.8  # correlation; what is less opposed may be chance
ROUND, TURN = "hip_flexion", 360.0  # the angle that goes all the way round: 190 degrees are -170
FLIP = 0.1  # by how much the correlation must gain for a curve to be taken as counted the other way


class Alignment(NamedTuple):
    """How a reference lies to our curves; found, and used only where a figure says so."""

    lag: float  # our samples by which ours come later, the same for all angles; NaN where none fits best
    signs: Mapping[str, int]  # -1 where the reference counts the other way
    gain: float = 0.0  # share of what is unlike without the lag that it explains

    @property
    def worth(self) -> float:
        """The lag, where it is worth taking out, else 0."""
        return self.lag if abs(self.lag) >= HALF and self.gain >= GAIN else 0.0


def resampled(at: F64, values: F64, wanted: F64, step: float) -> F64:
    """Return values (T,) known at times (T,), a step apart, at other times (U,): linear in between, NaN across gaps."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(wanted), np.nan)
    at, values = at[known], values[known]
    right = np.minimum(np.searchsorted(at, wanted), len(at) - 1)
    left = np.maximum(right - 1, 0)
    near = np.minimum(np.abs(wanted - at[left]), np.abs(wanted - at[right])) <= SLACK * step
    bridged = (at[left] <= wanted) & (wanted <= at[right]) & (at[right] - at[left] <= GAP * step)
    return np.where(near | bridged, np.interp(wanted, at, values), np.nan)


def at_our_frames(reference: Reference, columns: Mapping[str, F64], lag: float = 0.0) -> dict[str, F64]:
    """Return the curves (T,) of a reference at our frames, or a lag in frames before; NaN where it has nothing."""
    at, ours = clocks(reference, columns, lag)
    return {name: resampled(at, unwrapped(curve), ours, reference.step) for name, curve in reference.curves.items()}


def unwrapped(curve: F64) -> F64:
    """Return a curve (T,) deg that goes on past half a turn: nothing lies between 179 and -179."""
    smooth, known = curve.copy(), np.isfinite(curve)
    smooth[known] = np.unwrap(curve[known], period=TURN)
    return smooth


def beside(ours: F64, curve: F64, name: str) -> F64:
    """Return a curve (T,) deg of an angle by name at the turn that is nearest to ours: 190 beside -175 is -170."""
    return curve - TURN * np.round((curve - ours) / TURN) if name.startswith(ROUND) else curve


def clocks(reference: Reference, columns: Mapping[str, F64], lag: float) -> tuple[F64, F64]:
    """Return the samples (T,) of a reference and our frames (U,), or a lag in frames before, by one clock."""
    clock = columns["frame" if reference.by_frame else "time"]
    step = float(np.median(np.diff(clock))) if len(clock) > 1 else 0.0
    return reference.moments(clock), clock - lag * step


def align(columns: Mapping[str, F64], reference: Reference, longest_lag_s: float) -> Alignment:
    """Return the lag that all angles share and the sign of each.

    Every whole frame within the longest lag is tried; the correlation with the shifted reference, of all angles in one,
    is greatest at the lag. A parabola through that shift and its neighbours gives the fraction.
    """
    time = columns["time"]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    reach = max(1, round(longest_lag_s / step))
    shifts = np.arange(-reach, reach + 1)
    own = {name: unwrapped(curve) for name, curve in columns.items() if name in reference.curves}
    shifted = [at_our_frames(reference, columns, float(shift)) for shift in shifts]
    table = np.array([[_products(curve, each[name]) for name, curve in own.items()] for each in shifted])
    table = table.reshape(len(shifts), len(own), 3)
    together, ours, theirs = np.moveaxis(table, 2, 0)
    most = np.sqrt(ours * theirs)
    flipped = together < TURNED * most
    total = np.where(flipped, -together - FLIP * most, together).sum(axis=1)
    size = ours.sum(axis=1) * theirs.sum(axis=1)
    score = np.where(size > 0, total / np.sqrt(np.where(size > 0, size, 1.0)), -np.inf)
    best = int(np.argmax(score))
    if score[best] < LIKE:
        return Alignment(np.nan, dict.fromkeys(own, 1))
    signs = {name: -1 if each else 1 for name, each in zip(own, flipped[best], strict=True)}
    unlike = 1 - score[reach]  # without a lag; infinite where too few frames have both then
    gain = float((score[best] - score[reach]) / unlike) if 0 < unlike < np.inf else float(unlike > 0)
    return Alignment(turning_point(shifts, score, best), signs, gain)


def _products(ours: F64, theirs: F64) -> tuple[float, float, float]:
    """Return the products of two curves about their means: of both, of ours, of theirs; 0 where too few have both."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    if both.sum() < max(FEWEST, LEAST * len(ours)):
        return 0.0, 0.0, 0.0
    a, b = ours[both] - ours[both].mean(), theirs[both] - theirs[both].mean()
    return float(a @ b), float(a @ a), float(b @ b)
