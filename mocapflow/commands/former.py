"""Results of a former run in a run folder: set aside, so that no figure passes for one of the new run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mocapflow.errors import PipelineError

FORMER = "former"


def differing(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Return the labels of the stages that two runs, given by their keys, would make otherwise."""
    return [label for label in {**one, **other} if one.get(label) != other.get(label)]


def check_store(out: Path, store: Path) -> None:
    """Check that a store does not lie among the files of a run, which the next one sets aside.

    Raises:
        PipelineError: it does.
    """
    from mocapflow_export import layout

    taken = [(out / part).resolve() for part in (*layout.WRITTEN, Path(FORMER))]
    if any(store.resolve().is_relative_to(part) for part in taken):
        hint = f"beside it: --store {out / 'store.zarr'}"
        raise PipelineError("the store would lie among the files of the run", where=str(store), hint=hint)


def holds_results(out: Path) -> bool:
    """True where files lie in a folder, of whomever, that a run would write over."""
    from mocapflow_export import layout

    return any((out / part).exists() for part in (layout.ANGLES, layout.RUN, layout.REPORT))


def set_aside(out: Path) -> Path | None:
    """Move what a run has written into a numbered folder of its own and return that; None if there is nothing.

    Nothing is ever removed: people keep files of their own beside results.
    """
    from mocapflow_export import layout

    written = [part for part in layout.WRITTEN if (out / part).exists()]
    if not written:
        return None
    before = [int(path.name) for path in (out / FORMER).glob("*") if path.name.isdecimal()]
    former = out / FORMER / str(max(before, default=0) + 1)
    former.mkdir(parents=True)
    for part in written:
        (out / part).rename(former / part)
    return former
