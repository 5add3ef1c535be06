"""Commands that write a beginning of something."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from mocapflow.help import scaffold

ROLES = ", ".join(scaffold.KINDS)

app = typer.Typer(help="Begin something of your own.", no_args_is_help=True)


@app.callback()
def _new() -> None:
    """Keep `plugin` a command of its own name."""


@app.command()
def plugin(
    name: Annotated[str, typer.Argument(help="Of the package, without mocapflow-: my-dress.")],
    role: Annotated[
        str, typer.Option(help=f"What it adds: {ROLES}. A stage makes, changes or writes a track.")
    ] = "garment",
    out: Annotated[Path | None, typer.Option(help="The folder to make.", show_default="mocapflow-NAME")] = None,
) -> None:
    """Write a plugin package that works: a module, its test, ready to install and to be changed."""
    folder = out or Path(f"mocapflow-{name}")
    for path in scaffold.write_plugin(name, role, folder):
        typer.echo(path)
    typer.echo(f"to go on: pip install -e {shlex.quote(f'{folder}[test]')} && pytest {shlex.quote(str(folder))}")
