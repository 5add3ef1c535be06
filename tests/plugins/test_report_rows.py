"""The figures and words of the report, from a track of known ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_report import page, report_rows
from results_scene import demo_scene, stepping

from mocapflow.results import Evaluation, Track

NAMES = ("cam01", "cam02", "cam03", "cam04")


@pytest.fixture(scope="module")
def track() -> Track:
    """Ten frames, from frame 20 on, with an overlap of 0.9."""
    some = stepping(demo_scene().body, 10)
    return replace(some, frame=some.frame + 20)


def test_how_far_angles_move_how_sure_they_are_and_where_they_are_guesses() -> None:
    columns = {
        "frame": np.arange(3.0), "time": np.arange(3.0), "knee_flexion_l": np.array([20.0, 10.0, 40.0]),
        "knee_flexion_l_sd": np.array([1.0, 2.0, 9.0]), "knee_flexion_l_observed": np.array([0.4, 0.9, 0.1]),
    }  # fmt: skip
    (row,) = report_rows.ranges(columns)
    assert row.pop("degrees") == "knee flexion, left"
    assert list(row.values()) == pytest.approx([10, 40, 30, 2 * 1.6449, 2])


def test_the_time_of_a_step_and_its_share(track: Track) -> None:
    seconds = np.full((10, 2), [0.1, 0.2])
    seconds[4, 0] = 1.1  # one frame that began with compiling
    first, second = report_rows.times(replace(track, seconds=seconds))
    assert [first[name] for name in ("step", "s in total", "%")] == ["segment", pytest.approx(2), 50]
    assert (first["ms a frame, median"], second["ms a frame, median"]) == (pytest.approx(100), pytest.approx(200))
    assert "0.30 s of CPU a frame" in report_rows.glance(replace(track, seconds=seconds), NAMES, None)


def test_a_glance_at_a_good_track_beside_a_reference(track: Track) -> None:
    rows = ({"angle": "knee_flexion_r", "rms_deg": 3.04, "rms_aligned_deg": 1.5}, {"angle": "hip_flexion_l"})
    overlap = track.overlap.copy()
    overlap[:4, 2], overlap[5, 0] = np.nan, 0.99
    said = report_rows.glance(replace(track, overlap=overlap), NAMES, Evaluation(reference="a.csv", rows=rows))
    knee = "RMS deviation from the reference: knee flexion, right 3.0° (1.5° without lag and offset)"
    assert said[:3] == [
        knee,
        "overlap of model and image: 0.900 in the median of all frames and views",
        "no frame lost",
    ]


def test_frames_that_went_wrong_are_named(track: Track) -> None:
    turns, steady = track.iterations.copy(), track.steady.copy()
    turns[[2, 3, 4, 8]], steady[[2, 9]] = 0, False
    assert report_rows.mishaps(replace(track, iterations=turns, steady=steady), {"elbow_l": 3}) == [
        "frames lost and bridged: 22–24, 28",
        "2 of 10 frames did not come to rest: 22, 29",
        "elbow, left: held by the priors in 3 frames",
    ]
    notes = (*(f"frame {frame}: cam02 black" for frame in (21, 22, 23, 27)), "frame 25: seen by too few cameras")
    assert report_rows.notes(replace(track, notes=notes)) == [
        "frames 21–23, 27: cam02 black",
        "frame 25: seen by too few cameras",
    ]


def test_tables_have_a_header_and_two_decimals() -> None:
    made = page.table([{"rms_deg": 1.256, "of": "a < b"}, {"rms_deg": np.nan, "of": 3}])
    header = "<tr><th>rms deg</th><th>of</th></tr>"
    assert made == (f"<table>{header}\n<tr><td>1.26</td><td>a &lt; b</td></tr>\n<tr><td>–</td><td>3</td></tr></table>")
    assert page.table([]) == page.listing([]) == page.code("") == ""
    assert page.listing(["a", "b"]) == "<ul><li>a</li><li>b</li></ul>"
    whole = page.page("Run", "of today", [("Angles", made), ("Strides", "")])
    assert "<h1>Run</h1>" in whole and "<h2>Angles</h2>" in whole and made in whole and "Strides" not in whole
