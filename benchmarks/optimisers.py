"""Which optimiser finds the cloth with the fewest drapes? Errors of six after 50, 100 and 200 of them.

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/optimisers.py [SEEDS [BUDGET [FRAME ...]]]`, for frames of
the demo clip in a skirt (default 10 200 36 44 52, in which the knee comes down and the skirt swings). Unknown are the
take-up and the five forces, at the tracked pose; then a hip and a knee, too. The error is that of the cloth fitter
`gauss_newton`, but that distances go on beyond their band: half the weighted squared distance of the outline to the
silhouettes, and of the cloth to calm one. A start is off the track by a normal error of each unknown; all optimisers
have the same ones.

Everything is counted in drapes: an error takes one; normal equations by differences one an unknown and one more, by
the strand rule (the draper's own rates) one. Printed is how far the least error is above the least that any run found
on that frame, in percent of it: median and 10-90 % over the runs, by the drapes spent. Then medians: of the drapes
after which a run was done or stopped, and of its CPU seconds.
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from clothed_outline import Outline
from held_out_camera import RECORDING, tracked
from minimisers import MINIMISERS, Budget, Minimiser, Spent

from mocapflow.records import F64

LEG = ("hip_l.flexion", "hip_l.abduction", "hip_l.rotation", "knee_l.flexion")
PROBLEMS = {"take-up and forces": (), "a hip, a knee, take-up and forces": LEG}
LOOKS = (50, 100, 200)  # drapes after which errors are compared


class Run(NamedTuple):
    """What one run has found."""

    least: F64  # (DRAPES,) the least error after each drape
    drapes: int  # after which it was done, or stopped
    seconds: float  # of CPU


def main() -> None:
    words = [int(word) for word in sys.argv[1:]]
    seeds, drapes = (*words[:2], *(10, 200)[len(words) :])
    frames = words[2:] or [36, 44, 52]
    states, model = tracked(RECORDING, max(frames) + 1)
    for what, angles in PROBLEMS.items():
        together: dict[str, list[list[Run]]] = {name: [] for name in MINIMISERS}
        for frame in frames:
            problem = Outline(states[frame], model, angles)
            problem.equations(np.zeros(problem.unknowns), "strand")  # what is compiled or measured once
            for name, minimiser in MINIMISERS.items():
                together[name].append([run(minimiser, problem, seed, drapes) for seed in range(seeds)])
            tell(f"{what}: frame {frame}", {name: rows[-1:] for name, rows in together.items()})
        if len(frames) > 1:
            tell(f"{what}: all frames", together)


def run(minimiser: Minimiser, problem: Outline, seed: int, drapes: int) -> Run:
    """Minimise from the start of a seed, until the drapes are spent or the minimiser is done."""
    start = problem.within(np.random.default_rng(seed).normal(size=problem.unknowns))
    budget, begin = Budget(problem, drapes), time.process_time()
    with suppress(Spent):
        minimiser(budget, start, seed)
    least, seconds = np.array(budget.least), time.process_time() - begin
    return Run(np.pad(least, (0, drapes - len(least)), mode="edge"), len(least), seconds)


def tell(title: str, runs: dict[str, list[list[Run]]]) -> None:
    """Print by how many percent the errors of each minimiser are above the least of all on that frame."""
    errors = {name: np.array([[each.least for each in row] for row in rows]) for name, rows in runs.items()}
    floor = np.min([error.min(axis=(1, 2)) for error in errors.values()], axis=0)[:, None, None]
    frames, seeds, drapes = next(iter(errors.values())).shape
    looks = [1, *(look for look in LOOKS if look < drapes), drapes]
    print(f"{title}; {frames * seeds} runs; least error {', '.join(f'{each:.1f}' for each in floor.ravel())}")
    print(f"{'% above it after':26}{''.join(f'{look:>22}' for look in looks)}{'done':>6}{'CPU s':>7}")
    for name, error in errors.items():
        above = 100 * (error / floor - 1)[:, :, np.array(looks) - 1].reshape(-1, len(looks))
        cells = "".join(f"{spread(values):>22}" for values in above.T)
        done, seconds = np.median([each[1:] for row in runs[name] for each in row], axis=0)
        print(f"{name:26}{cells}{done:6.0f}{seconds:7.2f}", flush=True)


def spread(values: F64) -> str:
    """Return the median of values, and from where to where 80 % of them lie."""
    low, middle, high = np.percentile(values, [10, 50, 90])
    return f"{middle:.0f} [{low:.0f}, {high:.0f}]"


if __name__ == "__main__":
    main()
