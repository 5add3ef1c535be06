"""Stage `report`: one page that shows what a run did and how well."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from mocapflow_evaluation import comparison_plots, cycles
from mocapflow_export import layout, runjson, tables
from mocapflow_export.uncertainty import measured

from mocapflow.components import Stage
from mocapflow.geometry import kinematics
from mocapflow.io.atomic import atomic_write
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.results import Evaluation, Files, RunFolder, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow_report import page, plots, report_rows
from mocapflow_report.stills import stills

CAPTIONS = {
    layout.AGREEMENT_PLOT.name: "Agreement: difference over mean, with the mean difference and the limits of 95 % "
    "(Bland and Altman). Neighbouring frames hang together, so the limits are of this take.",
    layout.CYCLES_PLOT.name: "Over the gait cycle: every stride thin, their mean thick.",
    layout.STICK_PLOT.name: "Stick models from the front and from the side: ours, and the reference's in our rig.",
}
COMPILED = "s in total and % hold the compiling of kernels, where a run was the first to need them"


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
        checks: ViewChecks | None = None,
    ) -> Files:
        """Write the report and return its paths."""
        series = measured(track, scene)
        columns = tables.angle_columns(track, series)
        curves, overlap, *strides = draw(track, scene, columns, evaluation, run_folder.path)
        recipe = runjson.plain(run_folder.recipe)
        happened = [
            *recording.warnings,
            *scene.warnings,
            *runjson.said_by_stages(recipe),
            *report_rows.mishaps(track, runjson.held_by_priors(series)),
            *report_rows.notes(track),
        ]
        names = [camera.name for camera in scene.cameras]
        shown = stills(track, scene, recording, checks)
        sections = [
            ("At a glance", page.listing(report_rows.glance(track, names, evaluation))),
            ("Angles", _shown([curves]) + page.table(report_rows.ranges(columns))),
            ("Body", page.listing([report_rows.body(scene)])),
            ("Gait cycle", _shown(strides)),
            ("Deviation from the reference", _deviations(evaluation)),
            ("Overlay", "\n".join(page.picture(jpeg, "jpeg", said) for said, jpeg in shown)),
            ("Overlap of model and image", _shown([overlap])),
            ("What happened", page.listing(happened)),
            ("CPU time", page.table(report_rows.times(track)) + page.listing([COMPILED])),
            ("Versions", page.listing([f"{name} {version}" for name, version in recipe.get("versions", {}).items()])),
            ("Settings and recipe", page.code(json.dumps(recipe, indent=1, ensure_ascii=False))),
        ]
        counts = f"{len(track.frame)} frames, {len(scene.cameras)} cameras, {recording.run_rate:g} per second"
        subtitle = f"{recording.folder.name}: {counts}"
        path = layout.place(run_folder.path, layout.REPORT)
        with atomic_write(path) as part:
            part.write_text(page.page(run_folder.path.resolve().name, subtitle, sections), encoding="utf-8")
        return Files(paths=(path, curves, overlap, *strides))


def draw(
    track: Track, scene: Scene, columns: Mapping[str, F64], evaluation: Evaluation | None, folder: Path
) -> list[Path]:
    """Draw angles, overlap and, of somebody who walks without a reference, the gait cycle; return the files."""
    raw = tables.angle_columns(track, measured(track.before_smoothing, scene))
    curves, overlap = layout.place(folder, layout.PLOT), layout.place(folder, layout.OVERLAP)
    plots.plot_angles(curves, columns, raw, evaluation, track.lost)
    plots.plot_overlap(overlap, track, [camera.name for camera in scene.cameras], track.lost)
    compared = evaluation is not None and evaluation.rows  # then the strides of both are drawn
    return [curves, overlap, *([] if compared else _draw_strides(track, scene, columns, folder))]


def _draw_strides(track: Track, scene: Scene, columns: Mapping[str, F64], folder: Path) -> list[Path]:
    places = kinematics.joint_centres(scene.body, track.root, track.angles)
    strides = cycles.gait_cycles(scene.body.joint_names, places, track.frame_rate)
    names = [name for name in tables.angle_names(columns) if cycles.own(strides, name)]
    walked = {name: {"mocapflow": cycles.normalised(strides, columns[name], name)} for name in names}
    return [comparison_plots.draw_cycles(layout.place(folder, layout.CYCLES_PLOT), walked)] if walked else []


def _shown(pictures: Sequence[Path]) -> str:
    return "\n".join(page.picture(path.read_bytes(), "png", CAPTIONS.get(path.name, "")) for path in pictures)


def _deviations(evaluation: Evaluation | None) -> str:
    if evaluation is None or not evaluation.rows:
        return page.listing(evaluation.notes if evaluation else [])
    rows, said = report_rows.deviations(evaluation), report_rows.against(evaluation)
    return page.table(rows) + page.listing(said) + _shown(evaluation.pictures)
