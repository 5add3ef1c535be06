"""Commands that run a pipeline, or say what a run would do or has done."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.commands.former import check_store, differing, holds_results, set_aside
from mocapflow.commands.invocation import (
    Invocation,
    alone,
    finished_at,
    note_finished,
    placed,
    recall,
    recalled_keys,
    remember,
)
from mocapflow.commands.progress import last_word, noted, reporter
from mocapflow.commands.workers import Scheduler, Workers, finished
from mocapflow.errors import PipelineError

if TYPE_CHECKING:
    from mocapflow.config.pipeline import Pipeline
    from mocapflow.running.recipes import Step
    from mocapflow.running.runner import Prepared, RunSummary

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="A pipeline file (.yaml).")]
Recording = Annotated[Path | None, typer.Option(help="Use this recording folder instead of the file's.")]
Moved = Annotated[Path | None, typer.Option("--recording", metavar="DIR", help="Where the recording is now.")]
Out = Annotated[Path | None, typer.Option(help="The run folder.", show_default="runs/NAME_OF_PIPELINE")]
Store = Annotated[
    str | None,
    typer.Option(
        metavar="PATH|URL",
        help="Cached results, or a URL (s3://…) to share them.",
        show_default="store.zarr beside --out",
    ),
]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a value; repeatable.")]
Frames = Annotated[str | None, typer.Option(metavar="A:B[:STEP]", help="Only frames A up to, without, B.")]
Parts = Annotated[int | None, typer.Option(min=1, metavar="N", help="Track in N parts, and join them.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Compute everything anew.")]


def run(
    pipeline: File,
    recording: Recording = None,
    out: Out = None,
    store: Store = None,
    changes: Set = None,
    frames: Frames = None,
    parts: Parts = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    fresh: Fresh = False,
) -> None:
    """Run a pipeline; what is already in the store is not computed again.

    With several workers the parts of a long recording are tracked side by side.
    """
    folder = _out(pipeline, out)
    split = [f"parts.count={parts}"] if parts else []
    invocation = _invocation(pipeline, recording, folder, store, [*(changes or []), *split], frames)
    if fresh and (workers > 1 or scheduler is not None):
        raise PipelineError("--fresh does not go with several workers", hint="name a new store with --store")
    typer.echo(execute(invocation, folder, fresh, workers, scheduler))


def plan(
    pipeline: File,
    recording: Recording = None,
    out: Out = None,
    store: Store = None,
    changes: Set = None,
    frames: Frames = None,
) -> None:
    """Say what a run would take from the store, continue or compute, and why."""
    _print_plan(_invocation(pipeline, recording, _out(pipeline, out), store, changes, frames))


def status(
    run_folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")], recording: Moved = None
) -> None:
    """Say how far a run is."""
    _print_plan(recall(run_folder, recording))
    when = finished_at(run_folder)
    if said := last_word(run_folder) or (when and f"finished at {when}"):
        typer.echo(said)


def demo(out: Annotated[Path, typer.Option(help="The run folder.")] = Path("runs/demo")) -> None:
    """Track the example recording that comes with mocapflow."""
    from mocapflow.help.shipped import shipped

    execute(_invocation(shipped("pipelines", "demo.yaml"), None, out, None, None, None), out)
    typer.echo(f"overlay videos  {out / 'overlay'}")
    typer.echo(f"joint angles    {out / 'results' / 'angles.csv'}")


def parts_of(steps: Sequence[Step]) -> list[str]:
    """Return the labels of the parts of a track, which workers can make: none needs another's result.

    Raises:
        PipelineError: there are no parts.
    """
    labels = [step.label for step in steps if step.chain]
    if len(labels) < 2:
        raise PipelineError("there is nothing for several workers to do", hint="--parts N tracks in N parts")
    return labels


def make_parts(labels: Sequence[str], invocation: Invocation, out: Path, workers: int, scheduler: str | None) -> None:
    """Make the parts of a track on workers; a run finds them in the store."""
    tasks = {label: partial(make_part, invocation.absolute(), out.absolute(), label) for label in labels}
    for number, (label, result) in enumerate(finished(tasks, workers, scheduler), 1):
        result()
        typer.echo(f"{number} of {len(labels)}  {label}", err=True)


def make_part(invocation: Invocation, out: Path, label: str) -> None:
    """Make one part of a track and what it needs, on a worker."""
    from mocapflow.running import runner

    pipeline, store = invocation.load(), Path(invocation.store)
    with reporter() as report:
        runner.run(pipeline, store=store, url=invocation.url, out=out, only=label, report=report)


def begin(invocation: Invocation, out: Path, steps: Sequence[Step]) -> None:
    """Have a run folder remember what is run in it; what lies there of another run is set aside."""
    from mocapflow.running.component_failures import FAILURE_LOG

    (out / FAILURE_LOG).unlink(missing_ok=True)
    before, now = recalled_keys(out), {step.label: step.key for step in steps}
    another = holds_results(out) if before is None else differing(before, now)
    if another and (former := set_aside(out)):
        what = "what lay there under the names of results is" if before is None else "the results of the run before are"
        typer.echo(f"{what} now in {former}", err=True)
    remember(invocation, out, now, {step.label: step.content for step in steps})


def execute(
    invocation: Invocation, out: Path, fresh: bool = False, workers: int = 1, scheduler: str | None = None
) -> RunSummary:
    """Run what an invocation says, have the run folder remember it, and return the summary."""
    prepared = prepare(_loaded(invocation, out), invocation)
    prepared.check(out, fresh)
    parts = parts_of(prepared.steps) if workers > 1 or scheduler is not None else []
    with alone(out):  # from here on there is something to write
        begin(invocation, out, prepared.steps)
        if parts:
            make_parts(parts, invocation, out, workers, scheduler)
        summary = carry_out(prepared, out, fresh)
        note_finished(out)
        return summary


def prepare(pipeline: Pipeline, invocation: Invocation) -> Prepared:
    """Return the pipeline of an invocation with what it would make, and the store."""
    from mocapflow.running import runner

    return runner.prepare(pipeline, store=Path(invocation.store), url=invocation.url)


def carry_out(prepared: Prepared, out: Path, fresh: bool = False) -> RunSummary:
    """Run what is prepared, tell of its progress, and return the summary."""
    with reporter() as shown, noted(shown, out) as report:
        return prepared.run(out, fresh=fresh, report=report)


def _loaded(invocation: Invocation, out: Path) -> Pipeline:
    """Return the pipeline, before anything is written; a run folder or store within its recording is refused."""
    from mocapflow.running.runner import check_apart

    pipeline = invocation.load()
    check_apart(out, Path(invocation.store), pipeline.recording)
    check_store(out, Path(invocation.store))
    return pipeline


def _print_plan(invocation: Invocation) -> None:
    for line in prepare(invocation.load(), invocation).plan():
        typer.echo(line)


def _invocation(
    pipeline: Path, recording: Path | None, out: Path, store: str | None, changes: list[str] | None, frames: str | None
) -> Invocation:
    kept, url = placed(store, out.parent / "store.zarr")
    return Invocation(
        pipeline=str(pipeline),
        recording=str(recording) if recording else None,
        changes=tuple(changes or ()),
        frames=frames,
        store=kept,
        url=url,
    )


def _out(pipeline: Path, out: Path | None) -> Path:
    return out or Path("runs") / pipeline.stem
