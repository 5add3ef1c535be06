"""Variants side by side: known errors come out, and a paired difference knows what the two share."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.container import BarContainer
from matplotlib.figure import Figure
from mocapflow_evaluation import variants
from mocapflow_evaluation.compare import rms
from mocapflow_export import layout, tables

from mocapflow.config import levels

FRAMES = np.arange(90.0)
SHARED = 3 * np.sin(FRAMES / 5)


def finished(folder: Path, error: np.ndarray, lost: int = 0, frames: np.ndarray = FRAMES) -> Path:
    """Write what a run leaves behind."""
    tables.write_columns(layout.place(folder, layout.ERRORS), {"frame": frames, "knee_flexion_l": error})
    per_frame = [
        {
            "time": float(frames[row]) / 30,
            "iterations": 3,
            "steady": row % 3 == 0,
            "cpu_seconds": 9.0 if row == 5 else 0.2,
            **({"lost": True} if row < lost else {}),
        }
        for row in range(len(frames))
    ]
    layout.place(folder, layout.RUN).write_text(
        json.dumps({"per_frame": per_frame, "overlap_median": [0.9, None, 0.8]})
    )
    return folder


def test_figures_of_two_variants(tmp_path: Path) -> None:
    base, worse = finished(tmp_path / "base", SHARED), finished(tmp_path / "worse", SHARED + 1.0, lost=9)
    rows = variants.compare([("base", "take", base), ("worse", "take", worse)], tmp_path)
    assert [(row["variant"], row["angle"]) for row in rows] == [("base", "knee_flexion_l"), ("worse", "knee_flexion_l")]
    assert rows[0]["difference_deg"] == 0
    assert rows[1]["mae_deg"] == pytest.approx(np.abs(SHARED + 1).mean(), abs=1e-4)
    assert rows[1]["difference_deg"] == pytest.approx(rms(SHARED + 1) - rms(SHARED), abs=1e-4)
    with (tmp_path / "runs.csv").open() as file:
        runs = list(csv.DictReader(file))
    assert [float(run["lost"]) for run in runs] == [0.0, 0.1]
    assert float(runs[0]["overlap"]) == pytest.approx(0.85)
    assert float(runs[0]["not_at_rest"]) == pytest.approx(2 / 3, abs=1e-4)
    assert (float(runs[0]["cpu_seconds_per_frame"]), float(runs[0]["iterations"])) == (0.2, 3)
    assert (tmp_path / "compare.png").stat().st_size > 5000
    assert {path.name for path in tmp_path.iterdir() if path.is_file()} == set(levels.FILES)  # no variant is called so


def test_a_paired_difference_is_sharper_than_its_parts() -> None:
    difference, low, high = variants.paired_difference(1.05 * SHARED, SHARED, 30.0)
    alone_low, alone_high = variants.rms_interval(SHARED, 30.0)
    assert low <= difference <= high
    assert high - low < 0.2 * (alone_high - alone_low)
    assert low > 0


@pytest.mark.parametrize(("first", "step"), [(1, 1), (0, 2)])
def test_differences_are_of_the_same_frames(tmp_path: Path, first: int, step: int) -> None:
    base = finished(tmp_path / "base", SHARED[:40], frames=FRAMES[:40])
    kept = slice(first, first + 40 * step, step)
    other = finished(tmp_path / "other", SHARED[kept], frames=FRAMES[kept])
    _, row = variants.compare([("base", "take", base), ("other", "take", other)], tmp_path)
    assert (row["difference_deg"], row["difference_low_deg"], row["difference_high_deg"]) == (0, 0, 0)
    apart = finished(tmp_path / "apart", SHARED[40:80], frames=FRAMES[40:80])
    _, row = variants.compare([("base", "take", base), ("apart", "take", apart)], tmp_path)
    assert np.isnan(float(row["difference_deg"]))


def test_an_interval_is_of_the_frames_that_both_have(tmp_path: Path) -> None:
    every, second, frames = slice(None), slice(0, None, 2), np.arange(240.0)  # blocks of a second, as the take is long
    error = 3 * np.sin(frames**2 / 5000)
    base = finished(tmp_path / "base", error[second], frames=frames[second])
    runs = [finished(tmp_path / str(kept.step), 1.2 * error[kept], frames=frames[kept]) for kept in (every, second)]
    rows = [variants.compare([("base", "take", base), ("other", "take", run)], tmp_path)[1] for run in runs]
    low, high = variants.paired_difference(1.2 * error[second], error[second], 15.0)[1:]  # per second
    for row in rows:
        assert (row["difference_low_deg"], row["difference_high_deg"]) == pytest.approx((low, high), abs=1e-4)


def test_runs_without_a_reference_have_no_angles(tmp_path: Path) -> None:
    run = finished(tmp_path / "run", SHARED)
    variants.compare([("only", "take", run)], tmp_path)
    (run / layout.ERRORS).unlink()
    assert variants.compare([("only", "take", run)], tmp_path) == []
    assert (tmp_path / "runs.csv").is_file()
    assert not (tmp_path / "compare.png").exists()


def test_a_run_that_failed_is_a_row_and_the_others_are_compared(tmp_path: Path) -> None:
    base, good = finished(tmp_path / "base", SHARED), finished(tmp_path / "good", SHARED)
    why = "draper 'tiny' failed at frame 3, badly"
    rows = variants.compare([("base", "take", base), ("bad", "take", why), ("good", "take", good)], tmp_path)
    assert [row["variant"] for row in rows] == ["base", "good"]
    with (tmp_path / "runs.csv").open() as file:
        said = {run["variant"]: (run["frames"], run["overlap"], run["failed"]) for run in csv.DictReader(file)}
    assert said["bad"] == ("0", "", why)
    assert said["good"] == ("90", "0.8500", "")


def test_without_the_baseline_there_are_errors_but_no_differences(tmp_path: Path) -> None:
    good = finished(tmp_path / "good", SHARED)
    (row,) = variants.compare([("base", "take", "lost"), ("good", "take", good)], tmp_path)
    assert row["rms_deg"] == pytest.approx(rms(SHARED), abs=1e-4)
    assert np.isnan(float(row["difference_deg"]))


def test_bars_stand_side_by_side_as_high_as_their_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(variants.panels, "save", lambda figure, path: drawn.append(figure))
    known = {("a", "hip_l"): 3.0, ("a", "knee_l"): 4.0, ("b", "hip_l"): 5.0, ("b", "knee_l"): 6.0}
    variants.plot(tmp_path / "a.png", [
        {"recording": "take", "variant": variant, "angle": angle, "rms_deg": rms, "rms_low_deg": rms - 1.0,
         "rms_high_deg": rms + 2.0}
        for (variant, angle), rms in known.items()
    ])  # fmt: skip
    first, second = (each for each in drawn[0].axes[0].containers if isinstance(each, BarContainer))
    for bars, heights, aside in ((first, [3, 4], -0.2), (second, [5, 6], 0.2)):
        assert [bar.get_height() for bar in bars] == heights
        assert [bar.get_x() + bar.get_width() / 2 for bar in bars] == pytest.approx([aside, 1 + aside])
        whiskers = [segment[:, 1].tolist() for segment in bars.errorbar.lines[2][0].get_segments()]
        assert whiskers == [[height - 1, height + 2] for height in heights]
