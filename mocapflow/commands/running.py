"""Commands that run a pipeline, or say what a run would do or has done."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.errors import PipelineError

if TYPE_CHECKING:
    from mocapflow.pipeline import Pipeline

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="A pipeline file (.yaml).")]
Recording = Annotated[Path | None, typer.Option(help="Use this recording folder instead of the file's.")]
Out = Annotated[Path | None, typer.Option(help="The run folder. [default: runs/<name of the pipeline>]")]
Store = Annotated[
    Path | None, typer.Option(help="Where results are cached. [default: store.zarr beside the run folder]")
]
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
    loaded = _load(pipeline, recording, changes, frames)
    _run(loaded, out, store, fresh)


def plan(
    pipeline: File,
    recording: Recording = None,
    out: Out = None,
    store: Store = None,
    changes: Set = None,
    frames: Frames = None,
) -> None:
    """Say what a run would take from the store, continue or compute, and why."""
    from mocapflow import runner

    loaded = _load(pipeline, recording, changes, frames)
    for line in runner.plan(loaded, store=_store(store, _out(loaded, out))):
        typer.echo(line)


def status(run_folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]) -> None:
    """Say how far a run is."""
    raise PipelineError("not there yet", where=str(run_folder))


def demo(out: Annotated[Path, typer.Option(help="The run folder.")] = Path("runs/demo")) -> None:
    """Track the example recording that comes with mocapflow."""
    from mocapflow.shipped import shipped

    _run(_load(shipped("pipelines", "demo.yaml"), None, None, None), out, None, fresh=False)
    typer.echo(f"overlay videos: {out / 'results' / 'overlay'}")
    typer.echo(f"joint angles:   {out / 'results' / 'angles.csv'}")


def _run(loaded: Pipeline, out: Path | None, store: Path | None, fresh: bool) -> None:
    from mocapflow import runner

    folder = _out(loaded, out)
    summary = runner.run(loaded, store=_store(store, folder), out=folder, fresh=fresh, report=_report)
    typer.echo(summary)


def _report(line: str) -> None:
    typer.echo(line, err=True)


def _load(path: Path, recording: Path | None, changes: list[str] | None, frames: str | None) -> Pipeline:
    from mocapflow.pipeline import load_pipeline

    return load_pipeline(path, recording=recording, changes=changes or (), frames=_slice(frames))


def _slice(text: str | None) -> slice | None:
    if text is None:
        return None
    parts = text.split(":")
    if len(parts) not in {2, 3} or not all(part.isdecimal() or not part for part in parts):
        raise PipelineError("frames are written A:B or A:B:STEP, either end may be left out", where=f"--frames {text}")
    return slice(*(int(part) if part else None for part in parts))


def _out(loaded: Pipeline, out: Path | None) -> Path:
    return out or Path("runs") / loaded.name


def _store(store: Path | None, out: Path) -> Path:
    return store or out.parent / "store.zarr"
