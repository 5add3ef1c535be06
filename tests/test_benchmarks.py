"""Benchmarks that are quick enough still run: a figure is worth what the command beside it is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from mocapflow.help.shipped import shipped

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


CLIP = shipped("examples", "data", "skirt_steps")


@pytest.mark.long
@pytest.mark.parametrize(
    "call",
    [
        *(["draping"], ["flow"], ["help_time"], ["pose_solve"], ["segmentation"], ["silhouettes"], ["store_commit"]),
        *(["frame", CLIP, 4], ["wrong_pictures", CLIP], ["limb_lengths", CLIP, 2, 10]),
    ],
    ids=lambda call: call[0],
)
def test_a_benchmark_runs(call):
    script, *words = call
    command = [sys.executable, BENCHMARKS / f"{script}.py", *map(str, words)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
