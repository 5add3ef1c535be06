"""The report in a real browser, where one is installed: it shows, says nothing on the console, and prints."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from mocapflow_evaluation.evaluate import Evaluate
from mocapflow_export import layout
from mocapflow_report.report import Report
from results_scene import DEMO, demo_scene, stepping

from mocapflow.recordings.recording import open_recording
from mocapflow.results import RunFolder

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
pytestmark = [pytest.mark.long, pytest.mark.skipif(BROWSER is None, reason="no chromium or chrome is installed")]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the report of a track with everything in it: a reference, a lost frame, an angle that the priors hold."""
    folder, scene, recording = tmp_path_factory.mktemp("report"), demo_scene(), open_recording(DEMO, stop=12)
    run_folder = RunFolder(path=folder, recipe={"versions": {"numpy": "2"}})
    track = stepping(scene.body, 12)
    observed, iterations = track.observed.copy(), track.iterations.copy()
    observed[4:6], iterations[8] = 0.1, 0
    track = replace(
        track, observed=observed, iterations=iterations, overlap=np.random.default_rng(0).uniform(0.8, 1, (12, 4))
    )
    evaluation = Evaluate().run(track=track, scene=scene, recording=recording, run_folder=run_folder)
    Report().run(track=track, scene=scene, recording=recording, run_folder=run_folder, evaluation=evaluation)
    return folder / layout.REPORT


def browse(report: Path, tmp_path: Path, *words: str) -> str:
    """Open a page without a window and return what the browser logs."""
    switches = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    switches += ["--enable-logging=stderr", "--v=0", "--virtual-time-budget=5000"]
    done = subprocess.run(
        [str(BROWSER), *switches, *words, report.as_uri()], capture_output=True, text=True, check=True, timeout=120
    )
    return done.stderr


def test_it_shows_and_the_console_stays_empty(report: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    log = browse(report, tmp_path, f"--screenshot={shot}", "--window-size=1300,2600")
    assert ":CONSOLE" not in log
    picture = cv2.imread(str(shot))
    assert picture.shape == (2600, 1300, 3)
    assert (picture.std(axis=(1, 2)) > 5).mean() > 0.5  # half of the lines have something on them


def test_a_page_with_an_error_would_be_found_out(tmp_path: Path) -> None:
    page = tmp_path / "broken.html"
    page.write_text("<script>console.error('broken'); missing()</script>")
    assert browse(page, tmp_path, f"--screenshot={tmp_path / 'shot.png'}").count(":CONSOLE") == 2


def test_it_prints(report: Path, tmp_path: Path) -> None:
    browse(report, tmp_path, f"--print-to-pdf={tmp_path / 'report.pdf'}")
    pdf = (tmp_path / "report.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 12
    assert pdf.count(b"/Subtype /Image") >= 3
