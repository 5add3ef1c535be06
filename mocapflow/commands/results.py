"""Commands on a finished run: compare it, write it in other formats."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from mocapflow.commands.former import differing
from mocapflow.commands.invocation import alone, recall, recalled_keys
from mocapflow.commands.progress import reporter
from mocapflow.commands.running import Moved, carry_out, prepare
from mocapflow.errors import MocapflowError, PipelineError, RecordingError, alternatives

if TYPE_CHECKING:
    from mocapflow.config.pipeline import Pipeline

Run = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]
Truth = Annotated[
    Path | None, typer.Option(help="A .csv, .mot, .trc or .c3d to compare with.", show_default="the recording's")
]
Format = Annotated[
    list[str],
    typer.Option("--format", help="csv, mot, trc, bvh, c3d, gltf, movement, parquet, rrd or usd; repeatable."),
]
COLUMNS = ("angle", "frames", "rms_deg", "mae_deg", "offset_deg", "max_deg", "worst_frame")


def evaluate(run: Run, truth: Truth = None, recording: Moved = None) -> None:
    """Compare the joint angles of a run with known ones: those its own pipeline names, unless others are given.

    Settings are those of the run. A folder whose pipeline is not here is compared with what is given by the defaults.
    """
    from mocapflow_evaluation.evaluate import evaluate_run

    reference, missing, longest_lag_s = _comparison(run, truth, recording)
    if reference is None or reference.is_dir():
        again = "run its pipeline again" if truth is None else "--set stages.evaluate.reference=keypoints"
        named = f"{missing}\nname a file of known angles with --truth"
        hint = named if reference is None else f"keypoints are compared in a run: {again}"
        raise RecordingError("there is nothing to compare with", where=str(reference or run), hint=hint)
    with alone(run):
        evaluation = evaluate_run(run, reference, longest_lag_s)
    if not evaluation.rows:
        raise RecordingError("; ".join(evaluation.notes), where=str(reference))
    typer.echo(f"compared with {evaluation.reference}")
    typer.echo(table([{name: row[name] for name in COLUMNS} for row in evaluation.rows]))
    for note in evaluation.notes:
        typer.echo(f"note: {note}")
    typer.echo("all figures: results/evaluation.csv in the run folder")


def _comparison(run: Path, truth: Path | None, recording: Path | None) -> tuple[Path | None, str, float]:
    """Return what a run is compared with, or why there is nothing, and the longest lag to look for (s)."""
    from mocapflow_evaluation.evaluate import LONGEST_LAG_S, Evaluate, chosen
    from mocapflow_export import layout

    try:
        pipeline = recall(run, recording).load()
    except MocapflowError as error:
        if truth is None or not run.is_dir():
            raise
        typer.echo(f"warning: compared by the default settings, as those of the run can't be read: {error}", err=True)
        return truth, "", LONGEST_LAG_S
    stage = next((named.stage for named in pipeline.stages if isinstance(named.stage, Evaluate)), Evaluate())
    reference, missing = (truth, "") if truth else chosen(pipeline.recording, stage.reference)
    if truth is None and reference is not None and reference.is_dir() and (run / layout.KEYPOINTS).is_file():
        reference = run / layout.KEYPOINTS  # which the run has triangulated
    return reference, missing, stage.longest_lag_s


def export(run: Run, format_: Format, recording: Moved = None) -> None:
    """Write the track of a run in other formats into the run folder, and print where they are.

    Code may have changed since; pipeline and recording may not.
    """
    from mocapflow.running.former_code import as_made

    _check_formats(format_)
    invocation = recall(run, recording)
    pipeline = invocation.load()
    with alone(run):
        steps = prepare(pipeline, invocation).steps
        keys = recalled_keys(run) or {}
        changed = differing(keys, {step.label: step.key for step in steps})
        contents = recalled_keys(run, "contents")
        other = differing(contents, {step.label: step.content for step in steps}) if contents else changed
        if changed and other:
            what = f"pipeline, recording or mocapflow have changed since this run: {', '.join(other)}"
            hint = "run it again, then export: else its files would show two tracks"
            raise PipelineError(what, where=str(run), hint=hint)
        exporting = invocation.changed(*_only_formats(pipeline, format_))
        prepared = prepare(exporting.load(), exporting)
        if changed:
            with reporter() as report:
                prepared = as_made(prepared, keys, report)
        prepared.check(run)
        summary = carry_out(prepared, run)
    for line in (summary, *summary.files):
        typer.echo(line)


def _check_formats(formats: Sequence[str]) -> None:
    from mocapflow_export.export import Format as Known

    known = get_args(Known)
    for name in formats:
        if name not in known:
            raise PipelineError("there is no such format", where=f"--format {name}", hint=alternatives(name, known))


def _only_formats(pipeline: Pipeline, formats: Sequence[str]) -> list[str]:
    """Return the changes that leave nothing that writes but the track of each stage `export`, in other formats."""
    from mocapflow_export.export import Export

    from mocapflow.results import Evaluation, Files
    from mocapflow.running.wiring import makes

    wanted = json.dumps(list(formats))
    writers = [named for named in pipeline.stages if makes(named, Files | Evaluation)]
    exports = [named.label for named in writers if isinstance(named.stage, Export)]
    changes = [f"stages.{named.label}=null" for named in writers if named.label not in exports]
    for label in exports:
        changes += [f"stages.{label}.use=write_formats", f"stages.{label}.formats={wanted}"]
    return changes if exports else [*changes, f"stages.export={{use: write_formats, formats: {wanted}}}"]


def view(
    run: Run,
    show: Annotated[
        bool, typer.Option("--show/--no-show", help="Open the viewer, or only write results/scene.rrd.")
    ] = True,
    recording: Moved = None,
) -> None:
    """Look at a run in Rerun: cameras, images, outlines, body, garment and angles on one timeline."""
    export(run, ["rrd"], recording)
    scene = run / "results" / "scene.rrd"
    if show and (status := subprocess.run([sys.executable, "-m", "rerun", str(scene)], check=False).returncode):
        hint = "it needs a display; --no-show only writes this file, which `rerun` opens anywhere"
        raise MocapflowError(f"the viewer ended with status {status}", where=str(scene), hint=hint)


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows as text in columns."""
    names = list(rows[0])
    cells = [names, *([_cell(row[name]) for name in names] for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(names))]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in cells)


def _cell(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)
