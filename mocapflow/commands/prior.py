"""Commands on learned priors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mocapflow.errors import PipelineError, StoreError

app = typer.Typer(help="Learn which poses are likely.", no_args_is_help=True)


@app.callback()
def _prior() -> None:
    """Keep `fit` a command of its own name."""


@app.command()
def fit(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES", help="angles.csv, .mot, .bvh or joint rotations (.npz).")
    ],
    out: Annotated[Path, typer.Option("--out", help="The file to write; `parzen: {poses: FILE}` reads it.")],
    angles: Annotated[
        list[str] | None,
        typer.Option("--angle", help="A joint, or joint.angle; repeatable.", show_default="hips, knees, ankles, arms"),
    ] = None,
    percentile: Annotated[
        float, typer.Option(min=1, max=100, help="Of the distances to the nearest pose; 100: the largest.")
    ] = 100.0,
) -> None:
    """Learn the prior `parzen` from recorded motions; leave out the take that is to be tracked."""
    import numpy as np
    from mocapflow_bodies.template import Template
    from mocapflow_priors import density, training

    if out.suffix != ".npz" or out.resolve() in {file.resolve() for file in files}:
        hint = "--out poses.npz, beside the files it is learned from"
        raise PipelineError("--out names the file to write, a .npz that is none of FILES", where=str(out), hint=hint)
    learned = training.fit(files, Template().load(Path()), angles or training.FREE, percentile)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        density.write(out, learned)
    except OSError as error:
        hint = "--out names a .npz, in a folder that may be written"
        raise StoreError(f"can't be written: {error.strerror}", where=str(out), hint=hint) from None
    typer.echo(f"{out}: {len(learned.poses)} poses, bandwidth {np.degrees(learned.bandwidth):.1f}°")
    typer.echo(f"angles: {', '.join(learned.names)}")
