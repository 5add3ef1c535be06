"""Commands on the store of cached results."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.errors import MocapflowError, alternatives

if TYPE_CHECKING:
    from mocapflow.storage.artifacts import Artifact
    from mocapflow.storage.store import Store

app = typer.Typer(help="List, explain and prune cached results.", no_args_is_help=True)
Where = Annotated[Path, typer.Option("--store", help="The store.")]
DEFAULT = Path("runs/store.zarr")
DAY = 86400  # s


@app.command("list")
def list_(
    store: Where = DEFAULT,
    check: Annotated[bool, typer.Option("--check", help="Read all that is complete: is any of it cut off?")] = False,
) -> None:
    """List what is in the store, oldest first, then what is damaged."""
    kept = _opened(store)
    for artifact in kept.artifacts():
        if check and artifact.complete and (odd := _damage(artifact, kept)):
            typer.echo(f"{artifact.path.name:<32} damaged; made anew where a run needs it: {odd}")
            continue
        done = "complete" if artifact.complete else "unfinished"
        frames = f"{artifact.frames} frames" if artifact.frames else ""
        size = f"{_size(artifact.path) / 1e6:.1f} MB"
        made = str(artifact.attributes.get("created", ""))
        typer.echo(f"{artifact.path.name:<32} {done:<11} {frames:<12} {size:>10}  {made}")
    for path in [*kept.damaged(), *kept.aside()]:
        typer.echo(f"{path.name:<32} damaged; made anew where a run needs it, removed by `cache prune`")


@app.command()
def explain(
    name: Annotated[str, typer.Argument(help="A result of `cache list`, or the beginning of its name or its key.")],
    other: Annotated[str | None, typer.Argument(help="Say how this one was made differently.")] = None,
    store: Where = DEFAULT,
) -> None:
    """Say what a result was made from, or how two differ."""
    from mocapflow.caching.keys import all_changes

    one = _find(name, store)
    if other is None:
        typer.echo(json.dumps({**one.recipe, "versions": one.attributes.get("versions")}, indent=1, ensure_ascii=False))
    else:
        typer.echo("\n".join(all_changes(one.recipe, _find(other, store).recipe)) or "made from the same")


@app.command()
def prune(
    store: Where = DEFAULT,
    days: Annotated[float | None, typer.Option(help="Remove what was made more than this long ago.")] = None,
    unfinished: Annotated[bool, typer.Option("--unfinished", help="Remove what was not finished.")] = False,
    everything: Annotated[bool, typer.Option("--all", help="Remove all.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be removed.")] = False,
) -> None:
    """Remove results; damaged ones always go."""
    if days is not None and not days >= 0:  # so says nan, too
        raise typer.BadParameter("a number of days, 0 or more", param_hint="--days")
    kept, freed = _opened(store), list[int]()
    chosen = [artifact.path for artifact in kept.artifacts() if everything or _is_chosen(artifact, days, unfinished)]
    for path in [*chosen, *kept.damaged(), *kept.aside()]:
        size = _size(path)
        if kept.busy(path.name.rpartition("-")[2]) if dry_run else not kept.drop(path):
            typer.echo(f"kept {path.name}: a run is writing it", err=True)
            continue
        freed.append(size)
        typer.echo(f"{'would remove' if dry_run else 'removed'} {path.name}")
    typer.echo(f"{len(freed)} results, {sum(freed) / 1e6:.1f} MB")


def _is_chosen(artifact: Artifact, days: float | None, unfinished: bool) -> bool:
    if unfinished and not artifact.complete:
        return True
    if days is None:
        return False
    made = datetime.fromisoformat(str(artifact.attributes["created"]))
    return (datetime.now(made.tzinfo) - made).total_seconds() > days * DAY


def _opened(store: Path) -> Store:
    from mocapflow.storage.store import Store

    kept = Store(store)
    if not kept.state.is_dir():  # in another folder all would be taken for damaged results, and pruned
        hint = "a store is what `mocapflow run` keeps beside its run folders, as store.zarr; --store names it"
        raise MocapflowError("there is no store here", where=str(store), hint=hint)
    return kept


def _damage(artifact: Artifact, store: Store) -> str:
    """Return why a result can't be read back, "" where it can."""
    from mocapflow.storage.rows import Corrupted

    try:
        store.load(artifact)
    except Corrupted as error:
        return error.message
    return ""


def _find(name: str, store: Path) -> Artifact:
    artifacts = _opened(store).artifacts()
    found = [a for a in artifacts if a.path.name.startswith(name) or a.key.startswith(name)]
    if len(found) != 1:
        message = f"'{name}' is {'more than one result' if found else 'no result'} of this store"
        hint = alternatives(name, [artifact.path.name for artifact in found or artifacts])
        raise MocapflowError(message, where=str(store), hint=hint)
    return found[0]


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
