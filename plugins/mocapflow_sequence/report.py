"""Stage `report`: one page that shows what a run did and how well."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mocapflow.components import Stage
from mocapflow.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Evaluation, Files, RunFolder, Track
from mocapflow.scene import Scene
from mocapflow_sequence import layout, page, plots, runjson, tables
from mocapflow_sequence.alignment import at_our_frames
from mocapflow_sequence.export import before_smoothing
from mocapflow_sequence.lost import lost_rows
from mocapflow_sequence.overlay import Painter
from mocapflow_sequence.references import read_reference
from mocapflow_sequence.uncertainty import measured

COLUMNS = (
    "angle", "frames", "rms_deg", "rms_low_deg", "rms_high_deg", "rms_without_offset_deg", "mae_deg", "offset_deg",
    "max_deg", "worst_frame", "lag_frames", "coverage_90",
)  # fmt: skip
STILL_WIDTH = 1500  # px


class Report(Stage):
    """Writes report.html, which holds everything it shows, results/angles.png and results/overlap.png."""

    name: ClassVar[str] = "report"

    def run(
        self,
        track: Track,
        scene: Scene,
        recording: Recording,
        run_folder: RunFolder,
        evaluation: Evaluation | None = None,
    ) -> Files:
        """Write the report and return its paths."""
        curves = plot(track, scene, evaluation, run_folder.path)
        views, overlap = [camera.name for camera in scene.cameras], layout.place(run_folder.path, layout.OVERLAP)
        plots.plot_overlap(overlap, track, views, lost_rows(track))
        warnings = recording.warnings + scene.warnings
        summary = runjson.plain(runjson.summary(track, measured(track, scene), run_folder, warnings))
        sections = [
            ("Deviation from the reference", _deviations(evaluation)),
            ("Angles", page.picture(curves.read_bytes(), "png")),
            ("Overlay", "\n".join(stills(track, scene, recording))),
            ("Overlap of model and image", page.picture(overlap.read_bytes(), "png")),
            (
                "What happened",
                page.listing(
                    [*summary["warnings"], *_mishaps(track, summary["frames"]["held_by_priors"]), *summary["notes"]]
                ),
            ),
            ("CPU time", page.table(_times(track))),
            ("How it was made", page.code(json.dumps(summary["recipe"], indent=1, ensure_ascii=False))),
        ]
        counts = f"{len(track.frame)} frames, {len(scene.cameras)} cameras, {recording.frame_rate:g} per second"
        subtitle = f"{recording.folder.name}: {counts}"
        path = layout.place(run_folder.path, layout.REPORT)
        path.write_text(page.page(run_folder.path.resolve().name, subtitle, sections), encoding="utf-8")
        return Files(paths=(path, curves, overlap))


def plot(track: Track, scene: Scene, evaluation: Evaluation | None, folder: Path) -> Path:
    """Write results/angles.png and return its path."""
    ours = tables.angle_columns(track, measured(track, scene))
    raw = tables.angle_columns(track, measured(before_smoothing(track), scene))
    known: Mapping[str, F64] = {}
    if evaluation is not None and evaluation.rows:
        known = at_our_frames(read_reference(Path(evaluation.reference)), ours)
    return plots.plot_angles(layout.place(folder, layout.PLOT), ours, raw, known, evaluation)


def stills(track: Track, scene: Scene, recording: Recording) -> list[str]:
    """Return pictures of the best, median and worst frame by overlap, all views side by side."""
    import cv2

    chosen = chosen_rows(track)
    painter, found = Painter(scene), {}
    last = max((int(track.frame[row]) for row in chosen.values()), default=-1)
    for frame in recording.frames():
        if frame.index > last:
            break
        for what, row in chosen.items():
            if track.frame[row] == frame.index:
                views = [painter.paint(frame, track, row, view) for view in range(len(scene.cameras))]
                height = min(view.shape[0] for view in views)
                wall = np.hstack(
                    [cv2.resize(view, (round(view.shape[1] * height / view.shape[0]), height)) for view in views]
                )
                size = (STILL_WIDTH, round(wall.shape[0] * STILL_WIDTH / wall.shape[1]))
                jpeg = cv2.imencode(".jpg", cv2.resize(wall, size, interpolation=cv2.INTER_AREA))[1].tobytes()
                found[what] = page.picture(jpeg, "jpeg", f"{what}: frame {frame.index}, {_overlaps(track, row)}")
    return [found[what] for what in chosen if what in found]


def chosen_rows(track: Track) -> dict[str, int]:
    """Return the rows to show: best, median and worst overlap, or first, middle and last where none is known."""
    seen = np.isfinite(track.overlap)
    known = np.flatnonzero(seen.any(axis=1))
    if not len(known):
        middle = len(track.frame) // 2
        return {"first": 0, "middle": middle, "last": len(track.frame) - 1} if len(track.frame) else {}
    mean = np.where(seen, track.overlap, 0).sum(1)[known] / seen.sum(1)[known]
    order = known[np.argsort(-mean, kind="stable")]
    return {"best": int(order[0]), "median": int(order[len(order) // 2]), "worst": int(order[-1])}


def _overlaps(track: Track, row: int) -> str:
    known = [f"{value:.3f}" if np.isfinite(value) else "unseen" for value in track.overlap[row]]
    return "overlap per view " + ", ".join(known) if np.isfinite(track.overlap[row]).any() else "overlap unknown"


def _deviations(evaluation: Evaluation | None) -> str:
    if evaluation is None or not evaluation.rows:
        return page.listing(evaluation.notes if evaluation else [])
    rows = [{column: row[column] for column in COLUMNS} for row in evaluation.rows]
    return page.table(rows) + page.listing(
        [f"compared with {Path(evaluation.reference).name}; all frames count, failures too"]
    )


def _mishaps(track: Track, held: Mapping[str, int]) -> list[str]:
    lost, restless = track.frame[lost_rows(track)], track.frame[~track.steady]
    said = [f"frames lost and bridged: {', '.join(map(str, lost))}"] if len(lost) else []
    said += [f"frames that did not come to rest: {', '.join(map(str, restless))}"] if len(restless) else []
    return said + [f"{name}: no image shows it in {count} frames; the priors hold it" for name, count in held.items()]


def _times(track: Track) -> list[dict[str, Any]]:
    seconds = np.nan_to_num(track.seconds)
    rows = [{"step": n, "s in total": float(c.sum()), "ms a frame (median)": float(1e3 * np.median(c))}
            for n, c in zip(track.step_names, seconds.T, strict=True)] if len(seconds) else []  # fmt: skip
    return rows
