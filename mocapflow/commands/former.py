"""What a run folder holds of a former run: no figure may pass for one of another run."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

FORMER = "former"


def differing(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Return the labels of the stages that two runs, given by their keys, would make otherwise."""
    return [label for label in {**one, **other} if one.get(label) != other.get(label)]


def set_aside(out: Path) -> Path | None:
    """Move what a run has written into a folder of its own, in place of what lay there, and return that.

    None if there is nothing. Killed on the way, it goes on the next time.
    """
    from mocapflow_export import layout

    written = [part for part in layout.WRITTEN if (out / part).exists()]
    if not written:
        return None
    former, moving = out / FORMER, out / f"{FORMER}.part"
    moving.mkdir(exist_ok=True)
    for part in written:
        (out / part).rename(moving / part)
    if former.exists():
        shutil.rmtree(former)
    return moving.rename(former)
