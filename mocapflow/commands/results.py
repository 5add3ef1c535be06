"""Commands on a finished run: compare it, write it in other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mocapflow.errors import PipelineError

Run = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]


def evaluate(
    run: Run,
    truth: Annotated[Path | None, typer.Option(help="What to compare with. [default: that of the recording]")] = None,
) -> None:
    """Compare the joint angles of a run with known ones."""
    raise PipelineError("not there yet", where=str(run))


def export(
    run: Run,
    format_: Annotated[str, typer.Option("--format", help="csv, mot, trc")] = "csv",
) -> None:
    """Write the track of a run in another format."""
    raise PipelineError("not there yet", where=str(run))
