"""How much larger are the errors of the angles than the normal equations say?

`python benchmarks/calibrate_uncertainty.py RUN … [--check RUN …]`: fits one factor for all angles on run folders that
were compared with known motion, and says what the 90 % interval covers there, on every take by the factor of the
others, and on the runs to check. Put the factor into mocapflow_sequence/uncertainty.py.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mocapflow_sequence import layout, tables
from mocapflow_sequence.compare import NINETY, rms
from mocapflow_sequence.uncertainty import FACTOR

from mocapflow.records import F64

LOST_DEG = 10.0  # RMS of a curve whose limb was lost: no error of measurement
WANTED, CURVE, CURVES = 0.90, 0.75, 0.95  # of all values; of a single curve, in this share of the curves
FACTORS = np.arange(0.5, 10.0, 0.01)


class Curve(NamedTuple):
    """One angle of one take."""

    name: str
    error: F64  # (T,) deg
    sd: F64  # (T,) deg, as the normal equations have it

    def inside(self, factor: float) -> F64:
        """Return 1 where the interval holds the truth, else 0: (T,)."""
        return (np.abs(self.error) <= NINETY * factor * self.sd).astype(float)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--check", nargs="*", type=Path, default=[])
    asked = parser.parse_args()
    takes = [curves_of(run) for run in asked.runs]
    factor = fitted(sum(takes, []))
    print(f"errors hang together over {correlation_frames(sum(takes, [])):.0f} frames; factor {factor:.2f}")
    for run, take in zip(asked.runs, takes, strict=True):
        others = fitted(sum((other for other in takes if other is not take), []))
        print(f"{run.name:24} by the factor of the others ({others:.2f}): {told(take, others)}")
    print(f"{'fitted, together':24} {told(sum(takes, []), factor)}")
    checks = [curves_of(run) for run in asked.check]
    for run, take in zip(asked.check, checks, strict=True):
        print(f"{run.name:24} {told(take, factor)}")
    if checks:
        print(f"{'checked, together':24} {told(sum(checks, []), factor)}")


def curves_of(run: Path) -> list[Curve]:
    """Return the curves of a run folder that were compared with a reference."""
    ours, errors = tables.read_columns(run / layout.ANGLES), tables.read_columns(run / layout.ERRORS)
    curves = []
    for name in tables.angle_names(errors):
        known = np.isfinite(errors[name]) & np.isfinite(ours[f"{name}_sd"])
        curves.append(Curve(f"{run.name} {name}", errors[name][known], ours[f"{name}_sd"][known] / FACTOR))
    return curves


def kept(curves: list[Curve]) -> list[Curve]:
    """Return the curves of limbs that were not lost."""
    return [curve for curve in curves if rms(curve.error) <= LOST_DEG]


def fitted(curves: list[Curve]) -> float:
    """Return the least factor that covers what is wanted of all values, and of nearly every curve."""
    for factor in FACTORS:
        shares = [curve.inside(factor).mean() for curve in kept(curves)]
        if pooled(kept(curves), factor) >= WANTED and np.mean(np.array(shares) >= CURVE) >= CURVES:
            return float(factor)
    raise SystemExit(f"no factor up to {FACTORS[-1]:.0f} covers enough")


def pooled(curves: list[Curve], factor: float) -> float:
    """Return the share of all values that the interval covers."""
    return float(np.concatenate([curve.inside(factor) for curve in curves]).mean())


def correlation_frames(curves: list[Curve], lag: int = 5) -> float:
    """Return over how many frames whitened errors fall to 1/e, by their correlation at one lag."""
    z = [curve.error / curve.sd for curve in kept(curves)]
    both = sum(float(np.mean(a[lag:] * a[:-lag])) for a in z)
    alone = sum(0.5 * float(np.mean(a[lag:] ** 2 + a[:-lag] ** 2)) for a in z)
    return float(-lag / np.log(both / alone))


def told(curves: list[Curve], factor: float) -> str:
    """Return what an interval covers, in words."""
    whole = kept(curves)
    shares = {curve.name: curve.inside(factor).mean() for curve in whole}
    low = [f"{name} {share:.0%}" for name, share in shares.items() if share < CURVE]
    lost = len(curves) - len(whole)
    said = f"{pooled(whole, factor):.1%} covered" if whole else "every limb lost"
    said += f", {pooled(curves, factor):.1%} with {lost} curves of lost limbs" if lost else ""
    return said + f"; {len(low)} of {len(whole)} curves below {CURVE:.0%}" + (f": {', '.join(low)}" if low else "")


if __name__ == "__main__":
    main()
