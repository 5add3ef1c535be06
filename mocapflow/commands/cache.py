"""Commands on the store of cached results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="List, explain and prune cached results.", no_args_is_help=True)
Store = Annotated[Path, typer.Option(help="The store.")]


@app.command("list")
def list_(store: Store = Path("runs/store.zarr")) -> None:
    """List what is in the store."""
