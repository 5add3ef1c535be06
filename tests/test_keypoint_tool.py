"""The benchmark beside a keypoint tool is fair: keypoints on the true joints give nearly the true knees."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mocapflow_export import layout

from mocapflow.help.shipped import shipped
from tests.fixtures.true_keypoints import write_true_keypoints

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "keypoint_tool.py"
CLIP = shipped("examples", "data", "shorts_steps")


@pytest.mark.long
def test_true_keypoints_give_the_true_angles(tmp_path: Path) -> None:
    """The filter takes tenths of a degree; a body whose landmarks are not its joints keeps a constant difference.

    Beside them stands a run of a part of the recording, which is compared where it has frames.
    """
    write_true_keypoints(CLIP, tmp_path)
    header, *rows = (CLIP / "truth" / "angles.csv").read_text().splitlines()
    (tmp_path / "run" / "results").mkdir(parents=True)
    (tmp_path / "run" / layout.ANGLES).write_text("\n".join([header, *rows[20:]]))
    command = [sys.executable, SCRIPT, CLIP, tmp_path, tmp_path / "run"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith(("knee", "elbow"))]
    assert len(told) == 4
    triangulated, fitted_without_mean = (np.array([float(row[k].rstrip(",")) for row in told]) for k in (0, 3))
    assert triangulated.max() < 0.5
    assert fitted_without_mean[:2].max() < 1.0, "knees"
    assert all(row[4:] == ["0.0,", "0.0", "(20", "missing)"] for row in told)
