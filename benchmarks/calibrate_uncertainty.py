"""How much larger are the errors of the angles than the normal equations say?

`python benchmarks/calibrate_uncertainty.py RUN … [--check RUN …]`: fits by how many millimetres an outline is off, on
run folders that were compared with known motion, and says what the 90 % interval covers there, on every take by the
fit to the others, on the runs to check, and how many single curves even exact deviations would leave badly covered.
Put the value into mocapflow_export/uncertainty.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from mocapflow_evaluation.compare import NINETY, rms
from mocapflow_evaluation.tracked_motion import of_folder
from mocapflow_export import layout, tables
from mocapflow_export.uncertainty import OUTLINE_MM, excess, px_per_mm

from mocapflow.commands.invocation import recall
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F64

LOST_DEG = 10.0  # RMS of a curve whose limb was lost: no error of measurement
WANTED = 0.94  # of all values: between the 90 % that the interval promises and where few curves are far below
CURVE = 0.75  # of the values of a single curve
TRIED_MM = np.arange(0.0, 30.0, 0.02)


class Curve(NamedTuple):
    """One angle of one take."""

    name: str
    error: F64  # (T,) deg
    sd: F64  # (T,) deg, as the normal equations have it
    size: F64  # (T,) px per mm of the person in the images

    def whitened(self, outline_mm: float) -> F64:
        """Return the errors in standard deviations (T,)."""
        return self.error / (excess(self.size, outline_mm) * self.sd)

    def covered(self, outline_mm: float) -> float:
        """Return the share of the values that the 90 % interval holds."""
        return float(np.mean(np.abs(self.whitened(outline_mm)) <= NINETY))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--check", nargs="*", type=Path, default=[])
    asked = parser.parse_args()
    if len(asked.runs) < 2:
        parser.error("name two runs or more: each is judged by the fit to the others")
    takes = [curves_of(run) for run in asked.runs]
    every, checks = sum(takes, []), [curves_of(run) for run in asked.check]
    outline, memory = fitted(every), correlation_frames(every)
    print(f"errors hang together over {memory:.0f} frames; an outline is off by {outline:.2f} mm")
    own = []
    for run, take in zip(asked.runs, takes, strict=True):
        own.append(fitted(sum((other for other in takes if other is not take), [])))
        print(f"{run!s:24} by the others ({own[-1]:.2f} mm): {told(take, lambda _, mm=own[-1]: mm)}")
    theirs = {curve.name: mm for take, mm in zip(takes, own, strict=True) for curve in take}
    print(f"{'each by the others':24} {told(every, lambda curve: theirs[curve.name])}")
    print(f"{'fitted, together':24} {told(every, lambda _: outline)}")
    print(tails(np.abs(np.concatenate([curve.whitened(outline) for curve in kept(every)]))))
    for run, take in zip(asked.check, checks, strict=True):
        print(f"{run!s:24} {told(take, lambda _: outline)}")
    if checks:
        print(f"{'checked, together':24} {told(sum(checks, []), lambda _: outline)}")
    for share in (0.90, 0.925, 0.95):
        low = low_by_chance([len(curve.error) for curve in kept(every)], share, memory)
        print(f"exact deviations, {share:.1%} covered: {low.mean():.1f} curves below, none in {np.mean(low == 0):.0%}")


def curves_of(run: Path) -> list[Curve]:
    """Return the curves of a run folder that were compared with a reference."""
    ours, errors, pipeline = of_folder(run), read_columns(run / layout.ERRORS), recall(run).load()
    size = px_per_mm(ours.stick.places[:, 0], open_recording(pipeline.recording, scale=pipeline.scale).cameras)
    curves = []
    for name in tables.angle_names(errors):
        sd = ours.columns[f"{name}_sd"] / excess(size, OUTLINE_MM)
        known = np.isfinite(errors[name]) & np.isfinite(sd)
        curves.append(Curve(f"{run} {name}", errors[name][known], sd[known], size[known]))
    return curves


def kept(curves: list[Curve]) -> list[Curve]:
    """Return the curves of limbs that were not lost."""
    return [curve for curve in curves if rms(curve.error) <= LOST_DEG]


def fitted(curves: list[Curve]) -> float:
    """Return the least value in mm that covers what is wanted of all values."""
    whole = kept(curves)
    for outline in TRIED_MM:
        if pooled(whole, {curve.name: curve.covered(outline) for curve in whole}) >= WANTED:
            return float(outline)
    raise SystemExit(f"no outline up to {TRIED_MM[-1]:.0f} mm covers enough")


def correlation_frames(curves: list[Curve], lag: int = 5) -> float:
    """Return over how many frames errors fall to 1/e: of the median curve, by its correlation at one lag."""
    errors = [curve.error for curve in kept(curves)]
    alike = [2 * np.sum(a[lag:] * a[:-lag]) / np.sum(a[lag:] ** 2 + a[:-lag] ** 2) for a in errors]
    return float(-lag / np.log(np.median(alike)))


def low_by_chance(lengths: list[int], covered: float, memory: float, trials: int = 400) -> F64:
    """Return how many curves of such lengths are below with exact deviations and normal errors: (trials,).

    Args:
        lengths: frames of each curve.
        covered: share of all values within the interval.
        memory: frames in which the correlation of the errors falls to 1/e.
        trials: how often it is tried.
    """
    dice, kept_share, edge = np.random.default_rng(0), np.exp(-1 / memory), NormalDist().inv_cdf(0.5 + covered / 2)
    low = np.zeros(trials)
    for frames in lengths:
        error = dice.normal(size=(frames, trials))
        for frame in range(1, frames):
            error[frame] = kept_share * error[frame - 1] + np.sqrt(1 - kept_share**2) * error[frame]
        low += (np.abs(error) <= edge).mean(axis=0) < CURVE
    return low


def told(curves: list[Curve], outline_mm: Callable[[Curve], float]) -> str:
    """Return what an interval covers, in words."""
    shares = {curve.name: curve.covered(outline_mm(curve)) for curve in curves}
    whole = kept(curves)
    low = [f"{curve.name} {shares[curve.name]:.0%}" for curve in whole if shares[curve.name] < CURVE]
    lost = len(curves) - len(whole)
    said = f"{pooled(whole, shares):.1%} covered" if whole else "every limb lost"
    said += f", {pooled(curves, shares):.1%} with {lost} curves of lost limbs" if lost else ""
    return said + f"; {len(low)} of {len(whole)} curves below {CURVE:.0%}" + (f": {', '.join(low)}" if low else "")


def tails(size: F64) -> str:
    """Return whether errors are as large as their deviations, and as seldom large as normal ones, in words."""
    held = [f"{share:.0%} {np.mean(size <= NormalDist().inv_cdf(0.5 + share / 2)):.1%}" for share in (0.5, 0.9, 0.99)]
    return f"errors over deviations: RMS {rms(size):.2f}; intervals of {', '.join(held)}"


def pooled(curves: list[Curve], shares: dict[str, float]) -> float:
    """Return the share of all values of curves of which such shares are covered."""
    return float(np.average([shares[curve.name] for curve in curves], weights=[len(curve.error) for curve in curves]))


if __name__ == "__main__":
    main()
