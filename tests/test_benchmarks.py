"""Benchmarks that need no recording still run: a figure is worth what the command beside it is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["draping", "flow", "help_time", "pose_solve", "segmentation", "silhouettes", "store_commit"]
)
def test_a_benchmark_runs(name):
    script = BENCHMARKS / f"{name}.py"
    done = subprocess.run([sys.executable, script], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
