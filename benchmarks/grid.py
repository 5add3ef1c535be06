"""What a grid costs: eight runs on two dask workers against two processes, and what its variants share.

Throughput: eight variants of `bare.yaml` that cost the same, on two dask workers, and as two commands side by side that
run four of them each, with a store each. Sharing: two drapers by two sets of matchers on two recordings
(`large_motion.yaml`) as one grid, and as four commands one after another with a store each. CPU counts every process;
wall clock is only worth something on an idle machine.

usage: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/grid.py [FRAMES]
FRAMES is 24 a run if not given: about five minutes of two cores.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import yaml

from mocapflow.help.shipped import shipped

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
CLIPS = [str(shipped("examples", "data", f"{name}_steps")) for name in ("skirt", "shorts")]
NO_PICTURES = {f"stages.{stage}": None for stage in ("overlay", "virtual", "report")}
ALIKE = {f"v{k}": {"stages.track.steady.surface_mm": 2 + k / 1000} for k in range(8)}
DRAPERS = {"rings": None, "strands": {"stages.track.draper": {"use": "kinematic", "sweeps": 0}}}
MATCHERS = {"contours": {"stages.track.matchers": ["contour_icp", "containment"]}, "flow": None}


def experiment(folder: Path, name: str, pipeline: str, frames: int, recordings: list[str], **factors: Any) -> str:
    """Write an experiment file and return its name."""
    said = {
        "mocapflow": 1,
        "pipeline": str(shipped("pipelines", pipeline)),
        "recordings": recordings,
        "frames": f"0:{frames}",
        "change": NO_PICTURES,
        "factors": factors,
    }
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(said, sort_keys=False))
    return f"{name}.yaml"


def compare(folder: Path, file: str, *options: str) -> subprocess.Popen[str]:
    """Start `mocapflow compare` with a run folder and a store of its own."""
    name = Path(file).stem
    words = [str(MOCAPFLOW), "compare", file, "--out", f"{name}/grid", "--store", f"{name}/store.zarr", *options]
    with (folder / f"{name}.log").open("w") as log:
        return subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=log, text=True)


def timed(*rounds: list[subprocess.Popen[str]] | Any) -> tuple[float, float]:
    """Return wall and CPU seconds of rounds of commands; those of a round run side by side."""
    before, since = spent(), time.perf_counter()
    for start in rounds:
        for process in start():
            if process.wait():
                sys.exit(f"failed: {process.args}")
    return time.perf_counter() - since, spent() - before


def spent() -> float:
    """Return the CPU seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def computed(log: Path) -> Counter[str]:
    """Return how often each stage was computed."""
    lines = [line.partition("computed: ")[2].strip() for line in log.read_text().splitlines() if "computed: " in line]
    return Counter(stage for line in lines for stage in line.split(", "))


def throughput(folder: Path, frames: int) -> None:
    """Print eight runs on two workers against two processes."""
    names = list(ALIKE)
    files = {
        part: experiment(folder, part, "bare.yaml", frames, CLIPS[1:], variant={n: ALIKE[n] for n in chosen})
        for part, chosen in {"warm_up": names[:1], "eight": names, "first": names[:4], "second": names[4:]}.items()
    }
    timed(lambda: [compare(folder, files["warm_up"])])  # compiles the kernels, fills the file cache
    workers = timed(lambda: [compare(folder, files["eight"], "--workers", "2")])
    processes = timed(lambda: [compare(folder, files[part]) for part in ("first", "second")])
    print(f"eight runs of {frames} frames{'wall s':>20}{'CPU s':>10}{'runs a minute':>16}")
    for name, (wall, cpu) in {"two dask workers": workers, "two processes": processes}.items():
        print(f"  {name:30}{wall:14.1f}{cpu:10.1f}{480 / wall:16.1f}")
    print(f"  throughput {processes[0] / workers[0]:.2f} by wall clock, {processes[1] / workers[1]:.2f} by CPU")


def sharing(folder: Path, frames: int) -> None:
    """Print a grid of 2 x 2 x 2 against its variants one by one."""
    whole = experiment(folder, "whole", "large_motion.yaml", frames, CLIPS, draper=DRAPERS, matcher=MATCHERS)
    single = [
        experiment(folder, f"{d}_{m}", "large_motion.yaml", frames, CLIPS, draper={d: of_d}, matcher={m: of_m})
        for d, of_d in DRAPERS.items()
        for m, of_m in MATCHERS.items()
    ]
    warm = experiment(folder, "warm", "large_motion.yaml", 2, CLIPS, draper=DRAPERS, matcher=MATCHERS)
    timed(lambda: [compare(folder, warm)])  # compiles the kernels
    grid = timed(lambda: [compare(folder, whole)])
    alone = timed(*[lambda file=file: [compare(folder, file)] for file in single])
    print(f"2 drapers x 2 sets of matchers x 2 recordings, {frames} frames{'wall s':>10}{'CPU s':>10}  computed")
    counts = sum((computed(folder / f"{Path(file).stem}.log") for file in single), Counter())
    for name, (wall, cpu), times in (
        ("one grid", grid, computed(folder / "whole.log")),
        ("four commands", alone, counts),
    ):
        stages = ", ".join(f"{stage} {times[stage]}" for stage in ("background", "start", "flow", "track"))
        print(f"  {name:46}{wall:12.1f}{cpu:10.1f}  {stages}")
    print(f"  the grid takes {grid[0] / alone[0]:.2f} of the wall clock, {grid[1] / alone[1]:.2f} of the CPU")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    with tempfile.TemporaryDirectory() as name:
        print(f"load of the machine at the start: {os.getloadavg()[0]:.1f}")
        throughput(Path(name), count)
        sharing(Path(name), max(2, count // 2))
