"""Variants of a pipeline side by side: error per angle, difference to the first variant, overlap, time, frames lost."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mocapflow_export import layout, tables

from mocapflow.config.levels import FILES
from mocapflow.records import F64
from mocapflow.results import frame_rate_of
from mocapflow_evaluation import panels
from mocapflow_evaluation.compare import drawn_blocks, middle_95, rms, rms_interval
from mocapflow_evaluation.run_errors import angle_errors

Run = tuple[str, str, Path | str]  # variant, recording, run folder or why it failed
Row = dict[str, float | str]
COMPARED, RUNS, PICTURE = FILES
WENT = ("overlap", "cpu_seconds_per_frame", "iterations", "lost", "not_at_rest")


def compare(runs: Sequence[Run], folder: Path) -> list[Row]:
    """Write compare.csv, runs.csv and compare.png of runs and return the rows of the first.

    The first variant is the baseline. Differences of RMS are paired, over the frames that both have: the same blocks of
    frames are drawn from both. A run that failed has a row in runs.csv that says why.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    baseline = runs[0][0]
    errors = {(variant, recording): angle_errors(path) for variant, recording, path in runs}
    for variant, recording, path in runs:
        ours = errors[variant, recording]
        base = errors[baseline, recording].at(ours.frame)
        rate = frame_rate(Path(path)) if ours.angles else np.nan
        for angle, error in ours.angles.items():
            found = figures(error, base.get(angle), rate)
            rows.append({"recording": recording, "variant": variant, "angle": angle, **found})
    tables.write_rows(folder / COMPARED, rows)
    tables.write_rows(folder / RUNS, [{"recording": r, "variant": v, **run_figures(path)} for v, r, path in runs])
    (folder / PICTURE).unlink(missing_ok=True)
    if rows:
        plot(folder / PICTURE, rows)
    return rows


def frame_rate(run: Path) -> float:
    """Return the frames per second of a run."""
    said = json.loads((run / layout.RUN).read_text(encoding="utf-8"))
    return frame_rate_of(np.array([frame["time"] for frame in said["per_frame"]]))


def figures(error: F64, base: F64 | None, rate: float) -> Row:
    """Return what is said of an angle: its RMS and how much that differs from the baseline's, with 95 % intervals.

    Args:
        error: (T,) deg.
        base: (T,) deg, of the baseline at the same frames; None where it has no such angle.
        rate: frames per second.
    """
    seen = np.isfinite(error)
    low, high = rms_interval(error[seen], rate)
    row: Row = {"frames": int(seen.sum()), "rms_deg": rms(error[seen]), "rms_low_deg": low, "rms_high_deg": high}
    row["mae_deg"] = float(np.abs(error[seen]).mean())
    difference = (np.nan,) * 3
    if base is not None and (both := seen & np.isfinite(base)).any():
        shared = rate * both.sum() / seen.sum()  # frames per second that both have
        difference = paired_difference(error[both], base[both], float(shared))
    return row | dict(zip(("difference_deg", "difference_low_deg", "difference_high_deg"), difference, strict=True))


def paired_difference(error: F64, base: F64, rate: float) -> tuple[float, float, float]:
    """Return by how much the RMS of one error exceeds that of another, and its 95 % interval."""
    rows = drawn_blocks(len(error), rate)
    drawn = np.sqrt(np.mean(error[rows] ** 2, axis=1)) - np.sqrt(np.mean(base[rows] ** 2, axis=1))
    return rms(error) - rms(base), *middle_95(drawn, len(error))


def run_figures(run: Path | str) -> Row:
    """Return how a run went: overlap, CPU time, turns, shares of frames lost and not at rest; or why it failed."""
    if isinstance(run, str):
        return {"frames": 0, **dict.fromkeys(WENT, ""), "failed": run}
    said = json.loads((run / layout.RUN).read_text(encoding="utf-8"))
    frames = said["per_frame"]
    overlaps = [value for value in said["overlap_median"] if value is not None]
    went = (
        float(np.mean(overlaps)) if overlaps else np.nan,
        float(np.median([frame["cpu_seconds"] for frame in frames])),
        float(np.mean([frame["iterations"] for frame in frames])),
        float(np.mean([frame.get("lost", False) for frame in frames])),
        float(np.mean([not frame["steady"] for frame in frames])),
    )
    return {"frames": len(frames), **dict(zip(WENT, went, strict=True)), "failed": ""}


def plot(path: Path, rows: Sequence[Row]) -> None:
    """Draw the RMS of every angle and variant, one panel a recording."""
    recordings, variants, angles = (
        list(dict.fromkeys(str(row[name]) for row in rows)) for name in ("recording", "variant", "angle")
    )
    figure, every = panels.panels(len(recordings), columns=1, height=2.6, width=10.0, sharex=True)
    width = 0.8 / len(variants)
    for panel, recording in zip(every, recordings, strict=True):
        for index, variant in enumerate(variants):
            mine = [row for row in rows if (row["recording"], row["variant"]) == (recording, variant)]
            at = np.array([angles.index(str(row["angle"])) for row in mine])
            value, low, high = (
                np.array([float(row[name]) for row in mine]) for name in ("rms_deg", "rms_low_deg", "rms_high_deg")
            )
            at = at + (index - (len(variants) - 1) / 2) * width
            whiskers = np.maximum([value - low, high - value], 0)
            panel.bar(at, value, width, yerr=whiskers, label=variant, error_kw={"lw": 0.7})
        panel.set_axisbelow(True)
        panel.set_title(recording, loc="left", fontsize=10)
        panel.set_ylabel("RMS °")
        panel.set_xticks(range(len(angles)), angles, rotation=25)
    panels.legend(figure, every)
    panels.save(figure, path)
