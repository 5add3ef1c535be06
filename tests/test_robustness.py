"""Spoiled images, end to end: wrong frames are named and overcome (T-EXP4)."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from mocapflow.shipped import shipped

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
CLIP = shipped("examples", "data", "skirt_steps")
WRONG = {12: "does not fit", 13: "does not fit", 14: "does not fit", 20: "does not fit", 21: "does not fit"}
BACK = 3  # frames after wrong ones, by which the pose is right again


def tracked(out, pipeline, *more):
    """Run without pictures and return the errors of the left knee (degrees) and run.json."""
    quick = [word for stage in ("overlay", "virtual", "smooth") for word in ("--set", f"stages.{stage}=null")]
    command = [MOCAPFLOW, "run", shipped("pipelines", pipeline), "--recording", CLIP, "--out", out, *quick, *more]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    with (out / "results" / "angles.csv").open() as mine, (CLIP / "truth" / "angles.csv").open() as true:
        pairs = list(zip(csv.DictReader(mine), csv.DictReader(true), strict=False))
    errors = [abs(float(row["knee_flexion_l"]) - float(truth["knee_flexion_l"])) for row, truth in pairs]
    return errors, json.loads((out / "run.json").read_text())


@pytest.mark.long
def test_wrong_frames_are_named_and_the_pose_is_right_soon_after(tmp_path):
    errors, told = tracked(tmp_path / "run", "corrupted.yaml", "--frames", "0:26")
    assert told["frames"]["lost"] == list(WRONG)
    notes = {frame["frame"]: " ".join(frame.get("notes", [])) for frame in told["per_frame"]}
    assert all(why in notes[index] for index, why in WRONG.items())
    limit = max(1.5 * sorted(errors[2:12])[5], sorted(errors[2:12])[5] + 1)
    assert max(errors[14 + BACK : 20]) < limit + 1
    assert max(errors[21 + BACK :]) < limit + 1
