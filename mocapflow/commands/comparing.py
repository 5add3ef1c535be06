"""The command that runs an experiment: every variant on every recording, and what it makes of the angles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mocapflow.commands.again import Invocation
from mocapflow.commands.results import table
from mocapflow.commands.running import execute
from mocapflow.errors import MocapflowError, PipelineError

if TYPE_CHECKING:
    from mocapflow.experiment import Cell

RETRIES = 3  # of a run whose worker was lost: it goes on from the last frame committed
SHOWN = ("recording", "variant", "angle", "rms_deg", "difference_deg", "difference_low_deg", "difference_high_deg")


def compare(
    experiment: Annotated[Path, typer.Argument(metavar="EXPERIMENT", help="An experiment file (.yaml).")],
    recordings: Annotated[
        list[Path] | None, typer.Option("--recording", help="Instead of those of the file; repeatable.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Where to write.  [default: runs/NAME_OF_EXPERIMENT]")] = None,
    store: Annotated[Path | None, typer.Option(help="Cached results.  [default: store.zarr beside it]")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes on this machine.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="tcp://… of a running dask scheduler whose workers see the same files.")
    ] = None,
) -> None:
    """Run variants of a pipeline on recordings and compare them; stages they share are computed once."""
    from mocapflow.experiment import load_experiment

    folder = out or Path("runs") / experiment.stem
    cells = load_experiment(experiment, recordings or ())
    kept = store or folder.parent / "store.zarr"
    invocations = {place(folder, cell): invocation(cell, kept) for cell in cells}
    for each in invocations.values():
        each.load()  # tells what is wrong with any variant before the first one runs
    several = scheduler is not None or workers > 1
    done = on_workers(invocations, workers, scheduler) if several else one_by_one(invocations)
    for number, (run, said) in enumerate(done, 1):
        typer.echo(f"{number} of {len(cells)}  {run.relative_to(folder)}  {said}", err=True)
    from mocapflow_sequence import variants

    rows = variants.compare([(cell.variant, cell.name, place(folder, cell)) for cell in cells], folder)
    if rows:
        typer.echo(table([{name: row[name] for name in SHOWN} for row in rows]))
    typer.echo(f"all figures: {folder}/compare.csv, runs.csv and compare.png")


def place(folder: Path, cell: Cell) -> Path:
    """Return the run folder of a cell."""
    return folder / cell.variant / cell.name


def invocation(cell: Cell, store: Path) -> Invocation:
    """Return a cell as the command that runs it."""
    return Invocation(
        pipeline=str(cell.pipeline.absolute()),
        recording=str(cell.recording.absolute()),
        changes=cell.changes,
        frames=cell.frames,
        store=str(store.absolute()),
    )


def one_by_one(invocations: Mapping[Path, Invocation]) -> Iterator[tuple[Path, str]]:
    """Run all in this process."""
    for out, each in invocations.items():
        yield out, finish(each, out)


def on_workers(
    invocations: Mapping[Path, Invocation], workers: int, scheduler: str | None
) -> Iterator[tuple[Path, str]]:
    """Run all on dask workers: one at a time each, of one thread; the store's locks keep them out of each other's way.

    Raises:
        PipelineError: dask is not installed.
    """
    try:
        from dask import distributed
    except ImportError as error:
        raise PipelineError("several workers need dask", hint="pip install 'mocapflow[cluster]'") from error
    with connected(distributed, workers, scheduler) as client:
        futures = {client.submit(finish, each, out.absolute(), retries=RETRIES, pure=False): out
                   for out, each in invocations.items()}  # fmt: skip
        for future in distributed.as_completed(list(futures)):  # type: ignore[no-untyped-call]
            yield futures[future], future.result()


def connected(distributed: Any, workers: int, scheduler: str | None) -> Any:
    """Return a client of a running scheduler, or of workers of our own."""
    if scheduler is not None:
        return distributed.Client(scheduler)
    return distributed.Client(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)


def finish(invocation: Invocation, out: Path) -> str:
    """Run one cell and say which stages were computed."""
    try:
        summary = execute(invocation, out, fresh=False)
    except MocapflowError as error:
        message = f"{out.parent.name} on {out.name}: {error.message}"
        raise type(error)(message, where=error.where, hint=error.hint) from None
    computed = [stage["label"] for stage in summary.stages if not stage["cached"]]
    return f"computed: {', '.join(computed) or 'nothing'}"
