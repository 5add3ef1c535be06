"""Benchmarks that are quick enough still run: a figure is worth what the command beside it is."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from mocapflow.config.pipeline import load_pipeline
from mocapflow.help.shipped import shipped
from mocapflow.running.runner import run

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


CLIP = shipped("examples", "data", "skirt_steps")


@pytest.mark.long
@pytest.mark.parametrize(
    "call",
    [
        *(["draping"], ["flow"], ["help_time"], ["pose_solve"], ["segmentation"], ["silhouettes"], ["store_commit"]),
        *(["frame", CLIP, 4], ["wrong_pictures", CLIP], ["limb_lengths", CLIP, 2, 10], ["optimisers", 1, 30, 3]),
    ],
    ids=lambda call: call[0],
)
def test_a_benchmark_runs(call):
    script, *words = call
    command = [sys.executable, BENCHMARKS / f"{script}.py", *map(str, words)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def worst_knee(recording: Path, folder: Path) -> float:
    """Track the first frames of a recording in a skirt and return the larger error of its knees, deg RMS."""
    changes = [f"stages.{stage}=null" for stage in ("overlay", "virtual", "report")]
    skirt = shipped("pipelines", "skirt.yaml")
    pipeline = load_pipeline(skirt, recording=recording, changes=changes, frames=slice(0, 36))
    run(pipeline, store=folder / "store.zarr", out=folder / "run")
    with (folder / "run" / "results" / "evaluation.csv").open() as file:
        rms = {row["angle"]: float(row["rms_deg"]) for row in csv.DictReader(file)}
    return max(rms["knee_flexion_l"], rms["knee_flexion_r"])


@pytest.mark.long
@pytest.mark.parametrize("kind", ["dark", "drift", "furniture", "grey", "lamp", "lens", "world"])
def test_a_person_filmed_otherwise_is_tracked_as_well(tmp_path, kind):
    """Only those of geometry were not lost once, in some version of `exposure` or before occluders could be painted."""
    script = [sys.executable, BENCHMARKS / "filmed_otherwise.py", CLIP, tmp_path, kind]
    subprocess.run(script, check=True)
    assert worst_knee(tmp_path / kind, tmp_path) <= 3.0


@pytest.mark.long
def test_two_cameras_at_about_a_right_angle_do(tmp_path):
    subprocess.run([sys.executable, BENCHMARKS / "some_cameras.py", CLIP, tmp_path, "cam01,cam02"], check=True)
    assert worst_knee(tmp_path / "cam01,cam02", tmp_path) <= 3.0
