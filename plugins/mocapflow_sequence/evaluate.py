"""Stage `evaluate`: our angles against a reference, one row per angle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from mocapflow.components import Stage
from mocapflow.errors import RecordingError
from mocapflow.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Evaluation, RunFolder, Track
from mocapflow.scene import Scene
from mocapflow_sequence import compare, layout, tables
from mocapflow_sequence.export import before_smoothing
from mocapflow_sequence.references import read_reference
from mocapflow_sequence.uncertainty import measured

SLACK = 0.001  # s


class Evaluate(Stage):
    """Compares with truth/angles.csv of the recording, or with another file; without either it says so.

    `reference` is a .csv with our columns, an OpenSim .mot or a .trc of joint centres (relative to the recording).
    Rows with frame numbers are matched by them, others interpolated at our times. Failures are not left out.
    Writes results/evaluation.csv and, frame by frame, results/errors.csv.
    """

    name: ClassVar[str] = "evaluate"
    reference: str = ""  # a file, from the folder of the recording; empty: truth/angles.csv

    def run(self, track: Track, scene: Scene, recording: Recording, run_folder: RunFolder) -> Evaluation:
        """Return the evaluation of the track."""
        path = recording.folder / (self.reference or "truth/angles.csv")
        if not self.reference and not path.is_file():
            return Evaluation(
                reference="", rows=(), note="the recording has no truth/angles.csv, and no reference is set"
            )
        ours = tables.angle_columns(track, measured(track, scene))
        raw = tables.angle_columns(track, measured(before_smoothing(track), scene))
        return evaluate(ours, raw, path, run_folder.path)


def evaluate_run(run_folder: Path, truth: Path) -> Evaluation:
    """Compare results/angles.csv of a run folder with a reference file and write results/evaluation.csv.

    Raises:
        RecordingError: the run folder has no angles, or the reference can't be read.
    """
    path = run_folder / layout.ANGLES
    if not path.is_file():
        raise RecordingError("no such run folder: it has no results/angles.csv", where=str(run_folder))
    raw = run_folder / layout.RAW_ANGLES
    return evaluate(tables.read_columns(path), tables.read_columns(raw if raw.is_file() else path), truth, run_folder)


def evaluate(ours: Mapping[str, F64], raw: Mapping[str, F64], truth: Path, folder: Path) -> Evaluation:
    """Compare tables of angles (smoothed and raw) with a reference file; writes evaluation.csv and errors.csv."""
    reference = at_our_frames(read_reference(truth), ours)
    shared = [name for name in tables.angle_names(ours) if name in reference]
    rows: list[Mapping[str, float | str]] = []
    for name in shared:
        if not np.isfinite(reference[name]).any():
            continue
        sd = ours.get(f"{name}_sd", np.full(len(ours[name]), np.nan))
        row = compare.figures(ours[name], reference[name], sd, ours["frame"])
        unsmoothed = compare.figures(raw[name], reference[name], sd, ours["frame"])["rms_deg"]
        rows.append({"angle": name, **row, "rms_unsmoothed_deg": unsmoothed})
    note = "" if rows else "the reference shares no angle and frame with the track"
    errors = {str(row["angle"]): ours[str(row["angle"])] - reference[str(row["angle"])] for row in rows}
    tables.write_rows(layout.place(folder, layout.EVALUATION), rows)
    tables.write_columns(layout.place(folder, layout.ERRORS), {"frame": ours["frame"], **errors})
    return Evaluation(reference=str(truth), rows=tuple(rows), note=note)


def at_our_frames(reference: Mapping[str, F64], ours: Mapping[str, F64]) -> dict[str, F64]:
    """Return the reference at our frames: by number, or interpolated in time; NaN where it has nothing."""
    if "frame" not in reference:
        time = reference["time"]
        near = np.clip(ours["time"], time[0], time[-1])  # times are rounded, so the ends get a little slack
        far = np.abs(near - ours["time"]) > SLACK
        return {name: np.where(far, np.nan, np.interp(near, time, values)) for name, values in reference.items()}
    rows = {int(frame): row for row, frame in enumerate(reference["frame"])}
    row = np.array([rows.get(int(frame), -1) for frame in ours["frame"]])
    return {name: np.where(row >= 0, values[row], np.nan) for name, values in reference.items()}
