"""Stage `evaluate`: our angles against a reference, one row per angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from mocapflow_export import layout, runjson, tables
from pydantic import PositiveFloat

from mocapflow.components import Stage
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Evaluation, RunFolder, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow_evaluation import compare, comparison_plots, cycles, findings, tracked_motion
from mocapflow_evaluation.alignment import align, at_our_frames, beside, unwrapped
from mocapflow_evaluation.cycles import Cycle
from mocapflow_evaluation.keypoint_reference import low_pass, with_keypoints, write_triangulated
from mocapflow_evaluation.measured_points import SUFFIXES as POINTS
from mocapflow_evaluation.references import SUFFIXES, read_reference
from mocapflow_evaluation.rigs import COMMON_POINTS, compare_rigs
from mocapflow_evaluation.static_trial import STEM
from mocapflow_evaluation.stick import between_points
from mocapflow_evaluation.tracked_motion import TrackedMotion

LONGEST_LAG_S = 0.5  # s
Row = Mapping[str, float | str]


class Evaluate(Stage):
    """Compares with truth/angles.csv of the recording, with the one file in its reference/, or with another file.

    `reference` is a .csv with our columns, an OpenSim .mot, or a .trc or .c3d of joint centres or of markers on bony
    landmarks (relative to the recording; a standing trial beside it is used, see `static_trial`), or a folder of 2D
    keypoints like keypoints/, which are triangulated with the cameras of the run (`keypoint_reference`). Rows with
    frame numbers are matched by them, others interpolated at our times.
    Failures are not left out: evaluation.json tells the share of the frames that are lost, doubted or not at rest.
    A lag up to `longest_lag_s` that all angles share, and curves that count the other way, are reported;
    `rms_aligned_deg` alone is without them and without the mean offset. `rms_lowpassed_deg` is by our unsmoothed curve
    without what is faster than 6 Hz, as reference curves are filtered; NaN where a take is too short or too slow.
    Writes results/evaluation.csv and .json and, frame by frame, errors.csv; cycles.csv where somebody walks; and
    against joint centres (joints.npz beside the truth's angles, too) or markers joint_distances.csv and the
    reference's stick model.
    """

    name: ClassVar[str] = "evaluate"
    reference: str = ""  # from the folder of the recording; empty: truth/angles.csv, or the one in reference/
    longest_lag_s: PositiveFloat = LONGEST_LAG_S  # longest lag of one system behind the other that is looked for

    def need(self, recording: Recording) -> None:
        """Raise if what the track will be compared with is not there, or can't be read, points of both rigs too."""
        path, _ = chosen(recording.folder, self.reference)
        if path is None:
            return
        if path.is_dir():
            with_keypoints(recording, path)
            return
        reference, common_points = read_reference(path), path.parent / COMMON_POINTS
        if reference.joints is not None and not reference.in_our_world and common_points.is_file():
            between_points(common_points)

    def run(
        self,
        track: Track,
        scene: Scene,
        recording: Recording,
        run_folder: RunFolder,
        checks: ViewChecks | None = None,
    ) -> Evaluation:
        """Return the evaluation of the track."""
        layout.forget_comparison(run_folder.path)
        path, note = chosen(recording.folder, self.reference)
        if path is None:
            return Evaluation(reference="", rows=(), notes=(note,))
        if path.is_dir():
            path = write_triangulated(recording, path, scene.cameras, run_folder.path, checks)
        return evaluate(tracked_motion.of_track(track, scene), path, run_folder.path, self.longest_lag_s)


def chosen(recording: Path, wanted: str) -> tuple[Path | None, str]:
    """Return the file to compare with, or why there is none."""
    truth = recording / "truth/angles.csv"
    if wanted or truth.is_file():
        return (recording / wanted if wanted else truth), ""
    files = sorted((recording / "reference").glob("[!.]*"))
    beside = COMMON_POINTS, *(f"{STEM}{suffix}" for suffix in POINTS)
    there = [path for path in files if path.suffix.lower() in SUFFIXES and path.name not in beside]
    if len(there) == 1:
        return there[0], ""
    if not there:
        return None, "the recording has no truth/angles.csv and no reference/, and no reference is set"
    names = ", ".join(path.name for path in there)
    return None, f"reference/ holds {names}: name one, e.g. --set stages.evaluate.reference=reference/{there[0].name}"


def evaluate_run(run_folder: Path, truth: Path, longest_lag_s: float = LONGEST_LAG_S) -> Evaluation:
    """Compare the files of a run folder with a reference file; writes into the run folder.

    Raises:
        RecordingError: the run folder has no angles, or the reference can't be read.
    """
    return evaluate(tracked_motion.of_folder(run_folder), truth, run_folder, longest_lag_s)


def evaluate(own: TrackedMotion, path: Path, folder: Path, longest_lag_s: float = LONGEST_LAG_S) -> Evaluation:
    """Compare with a reference file; writes tables, what was found of both systems, and pictures into a run folder."""
    reference = read_reference(path)
    if path.resolve() == (folder / layout.KEYPOINTS).resolve():  # triangulated with the cameras of the run
        reference = replace(reference, in_our_world=True)
    shared = cycles.shared(own.columns, at_our_frames(reference, own.columns))
    known = {name: beside(own.columns[name], curve, name) for name, curve in shared.items()}
    alignment = align(own.columns, reference, longest_lag_s)
    aligned = at_our_frames(reference, own.columns, alignment.worth)
    strides = cycles.gait_cycles(own.stick.names, own.stick.places, own.frame_rate)
    rows = [
        _row(own, name, curve, alignment.signs[name] * aligned[name], strides) | {"sign": alignment.signs[name]}
        for name, curve in known.items()
    ]
    rigs = compare_rigs(own, reference, alignment.worth, path.parent / COMMON_POINTS)
    notes = [*reference.notes, *rigs.notes]
    if not rows:  # a comparison that a command wrote before stays
        notes.append(findings.nothing_shared(own, reference))
        return Evaluation(reference=str(path), rows=(), notes=tuple(notes))
    layout.forget_comparison(folder, but=layout.KEYPOINTS)  # it may be what is compared with, and can be again
    notes += findings.said(own, reference, alignment, strides, longest_lag_s)
    _write_tables(folder, own.columns, known, rows, strides)
    found = {"reference": str(path), "lag_frames": alignment.lag, "signs": alignment.signs}
    found |= {"flagged_share": own.flagged_share, "notes": notes}
    runjson.write(layout.place(folder, layout.FINDINGS), {**found, "registration": rigs.figures})
    written = rigs.write(folder, own.frame_rate, float(own.columns["time"][0]))
    pictures = [*comparison_plots.draw(own.columns, known, strides, folder), *written]
    return Evaluation(reference=str(path), rows=tuple(rows), notes=tuple(notes), pictures=tuple(pictures), curves=known)


def _write_tables(
    folder: Path, columns: Mapping[str, F64], known: Mapping[str, F64], rows: Sequence[Row], strides: Sequence[Cycle]
) -> None:
    """Write the figures of each angle, its errors frame by frame, and the figures of each stride."""
    errors = {name: columns[name] - curve for name, curve in known.items()}
    tables.write_rows(layout.place(folder, layout.EVALUATION), rows)
    tables.write_columns(layout.place(folder, layout.ERRORS), {"frame": columns["frame"], **errors})
    if walked := cycles.rows(strides, columns, known):
        tables.write_rows(layout.place(folder, layout.CYCLES), walked)


def _row(own: TrackedMotion, name: str, known: F64, aligned: F64, strides: Sequence[Cycle]) -> dict[str, float | str]:
    """Return the figures of one angle against its reference as it is, and as aligned with us."""
    curve, frame = unwrapped(own.columns[name]), own.columns["frame"]
    unknown = np.full(len(curve), np.nan)
    sd, raw = own.columns.get(f"{name}_sd", unknown), unwrapped(own.raw.get(name, unknown))
    known, filtered = beside(curve, known, name), low_pass(raw, own.frame_rate, filtered_alone=True)
    error = curve - beside(curve, aligned, name)
    error = error[np.isfinite(error)]
    return {
        "angle": name,
        **compare.figures(curve, known, sd, frame, own.frame_rate),
        "rms_unsmoothed_deg": compare.rms(beside(known, raw, name) - known),
        "rms_lowpassed_deg": compare.rms(beside(known, filtered, name) - known),
        "rms_aligned_deg": compare.rms(error - np.mean(error)) if len(error) else np.nan,
        "cycles": len(cycles.own(strides, name)),
        "cmc_cycles": cycles.across(strides, curve, known, name),
    }
