"""The command that runs an experiment: every variant on every recording, and what it makes of the angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.commands.invocation import Invocation, placed
from mocapflow.commands.results import table
from mocapflow.commands.running import Frames, Store, execute
from mocapflow.commands.workers import Scheduler, Workers, finished
from mocapflow.errors import MocapflowError, PipelineError

if TYPE_CHECKING:
    from mocapflow.config.experiment import Cell

SHOWN = ("recording", "variant", "angle", "rms_deg", "difference_deg", "difference_low_deg", "difference_high_deg")


def compare(
    experiment: Annotated[Path, typer.Argument(metavar="EXPERIMENT", help="An experiment file (.yaml).")],
    recordings: Annotated[
        list[Path] | None, typer.Option("--recording", help="Instead of those of the file; repeatable.")
    ] = None,
    frames: Frames = None,
    out: Annotated[Path | None, typer.Option(help="Where to write.", show_default="runs/NAME_OF_EXPERIMENT")] = None,
    store: Store = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Run variants of a pipeline on recordings and compare them; stages they share are computed once.

    A run that fails is told at the end, with an exit status of 1; the others go on.
    """
    from mocapflow.config.experiment import load_experiment

    folder = out or Path("runs") / experiment.stem
    cells = load_experiment(experiment, recordings or (), frames)
    kept, url = placed(store, folder.parent / "store.zarr")
    invocations = {cell: invocation_of(cell, kept, url) for cell in cells}
    for cell, each in invocations.items():
        check_cell(cell, each)  # all of them before the first one runs
    tasks = {cell: partial(run_cell, each, run_folder(folder, cell).absolute()) for cell, each in invocations.items()}
    failed = {}
    for number, (cell, result) in enumerate(finished(tasks, workers, scheduler), 1):
        try:
            said = result()
        except MocapflowError as error:
            failed[cell], said = error.message, f"failed: {error}"
        typer.echo(f"{number} of {len(cells)}  {cell.variant}/{cell.name}  {said}", err=True)
    show(folder, cells, failed)
    if failed:
        raise typer.Exit(1)


def check_cell(cell: Cell, invocation: Invocation) -> None:
    """Check that a cell can run and will leave what is compared.

    Raises:
        MocapflowError: it can't, or won't; with the variant, and the line of the experiment that says so.
    """
    from mocapflow_export.export import Export

    said_at = {f"--set {change}": place for change, place in zip(cell.changes, cell.places, strict=True)}
    try:
        stages = invocation.load().stages
        if not any(isinstance(named.stage, Export) for named in stages):
            hint = "add one: what it writes into run.json is compared"
            raise PipelineError("the pipeline has no stage `export`", where=invocation.pipeline, hint=hint)
    except MocapflowError as error:
        where = said_at.get(error.where, error.where)
        raise type(error)(f"variant '{cell.variant}': {error.message}", where=where, hint=error.hint) from None


def show(folder: Path, cells: Sequence[Cell], failed: Mapping[Cell, str]) -> None:
    """Compare what has run, and print it with what has not."""
    from mocapflow_evaluation import variants

    from mocapflow.config.levels import FILES

    runs = [(cell.variant, cell.name, failed.get(cell) or run_folder(folder, cell)) for cell in cells]
    rows = [{name: row[name] for name in SHOWN} for row in variants.compare(runs, folder)]
    compared = {(row["variant"], row["recording"]) for row in rows}
    alone = [f"{c.variant}/{c.name}" for c in cells if c not in failed and (c.variant, c.name) not in compared]
    rows += [{**dict.fromkeys(SHOWN, ""), "recording": c.name, "variant": c.variant, "angle": "failed"} for c in failed]
    if rows:
        typer.echo(table(rows))
    if alone:
        typer.echo(f"not compared, for they lack a truth or reference, or a stage evaluate: {', '.join(alone)}")
    for cell, message in failed.items():
        typer.echo(f"failed: {cell.variant} on {cell.name}: {message}")
    typer.echo(f"all figures: {folder}/{', '.join(name for name in FILES if (folder / name).is_file())}")


def run_folder(folder: Path, cell: Cell) -> Path:
    """Return the run folder of a cell."""
    return folder / cell.variant / cell.name


def invocation_of(cell: Cell, store: str, url: str | None) -> Invocation:
    """Return a cell as the command that runs it."""
    return Invocation(
        pipeline=str(cell.pipeline),
        recording=str(cell.recording),
        changes=cell.changes,
        folder=str(cell.folder),
        frames=cell.frames,
        store=store,
        url=url,
    ).absolute()


def run_cell(invocation: Invocation, out: Path) -> str:
    """Run one cell and say which stages were computed."""
    summary = execute(invocation, out, fresh=False)
    computed = [stage["label"] for stage in summary.stages if not stage["cached"]]
    return f"computed: {', '.join(computed) or 'nothing'}"
