"""Commands that write a beginning of something."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Begin something of your own.", no_args_is_help=True)


class Role(StrEnum):
    """What a new plugin may be."""

    GARMENT = "garment"
    DRAPER = "draper"
    MATCHER = "matcher"
    PRIOR = "prior"


@app.callback()
def _new() -> None:
    """Keep `plugin` a command of its own name."""


@app.command()
def plugin(
    name: Annotated[str, typer.Argument(help="Of the package, without mocapflow-: my-dress.")],
    role: Annotated[Role, typer.Option(help="What it adds.")] = Role.GARMENT,
    out: Annotated[Path | None, typer.Option(help="The folder to make.  [default: mocapflow-NAME]")] = None,
) -> None:
    """Write a plugin package that works: a module, its test, ready to install and to be changed."""
    from mocapflow.scaffold import write_plugin

    folder = out or Path(f"mocapflow-{name}")
    for path in write_plugin(name, role.value, folder):
        typer.echo(path)
    typer.echo(f"to go on: pip install -e {folder} && pytest {folder}")
