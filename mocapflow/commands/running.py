"""Commands that run a pipeline, or say what a run would do or has done."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.commands.again import Invocation, recall, remember
from mocapflow.commands.progress import last_word, noted, reporter

if TYPE_CHECKING:
    from mocapflow.runner import RunSummary

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="A pipeline file (.yaml).")]
Recording = Annotated[Path | None, typer.Option(help="Use this recording folder instead of the file's.")]
Out = Annotated[Path | None, typer.Option(help="The run folder.  [default: runs/NAME_OF_PIPELINE]")]
Store = Annotated[Path | None, typer.Option(help="Cached results.  [default: store.zarr beside the run folder]")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a value; repeatable.")]
Frames = Annotated[str | None, typer.Option(metavar="A:B", help="Only frames A up to, without, B.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Compute everything anew.")]


def run(
    pipeline: File,
    recording: Recording = None,
    out: Out = None,
    store: Store = None,
    changes: Set = None,
    frames: Frames = None,
    fresh: Fresh = False,
) -> None:
    """Run a pipeline; what is already in the store is not computed again."""
    folder = _out(pipeline, out)
    typer.echo(execute(_invocation(pipeline, recording, folder, store, changes, frames), folder, fresh))


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


def status(run_folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]) -> None:
    """Say how far a run is."""
    _print_plan(recall(run_folder))
    if said := last_word(run_folder):
        typer.echo(said)


def demo(out: Annotated[Path, typer.Option(help="The run folder.")] = Path("runs/demo")) -> None:
    """Track the example recording that comes with mocapflow."""
    from mocapflow.shipped import shipped

    execute(_invocation(shipped("pipelines", "demo.yaml"), None, out, None, None, None), out, fresh=False)
    typer.echo(f"overlay videos  {out / 'overlay'}")
    typer.echo(f"joint angles    {out / 'results' / 'angles.csv'}")


def execute(invocation: Invocation, out: Path, fresh: bool) -> RunSummary:
    """Run what an invocation says and return the summary."""
    pipeline = invocation.load()
    from mocapflow import runner

    remember(invocation, out)
    with noted(reporter(), out) as report:
        return runner.run(pipeline, store=Path(invocation.store), out=out, fresh=fresh, report=report)


def _print_plan(invocation: Invocation) -> None:
    pipeline = invocation.load()
    from mocapflow import runner

    for line in runner.plan(pipeline, store=Path(invocation.store)):
        typer.echo(line)


def _invocation(
    pipeline: Path, recording: Path | None, out: Path, store: Path | None, changes: list[str] | None, frames: str | None
) -> Invocation:
    return Invocation(
        pipeline=str(pipeline),
        recording=str(recording) if recording else None,
        changes=tuple(changes or ()),
        frames=frames,
        store=str(store or out.parent / "store.zarr"),
    )


def _out(pipeline: Path, out: Path | None) -> Path:
    return out or Path("runs") / pipeline.stem
