"""The levels of an experiment's factors: what each changes and where the file says so, and which can't be."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from mocapflow.config.documents import BEFORE, Document, KeyPath
from mocapflow.errors import PipelineError

ELSEWHERE = "recording"  # of a pipeline: an experiment says in `recordings` what it runs on
FILES = ("compare.csv", "runs.csv", "compare.png")  # that stand beside the folders of the variants
LONGEST = 255  # bytes of the name of a folder


class Override(NamedTuple):
    """A value that a variant sets."""

    value: Any
    where: str  # file:line:column


class Level(NamedTuple):
    """One level of a factor."""

    name: str
    changes: Mapping[str, Override]  # by path, as in --set
    where: str


def changes_at(said: Mapping[str, Any] | None, steps: KeyPath, document: Document) -> dict[str, Override]:
    """Return what is said at a place of the file as changes, each with where it is written.

    Raises:
        PipelineError: one would name a recording.
    """
    changes = {path: Override(value, document.place((*steps, path)).text) for path, value in (said or {}).items()}
    if ELSEWHERE in changes:
        hint = "write the folder under `recordings`: every variant runs on each of them"
        raise PipelineError(f"a variant can't change '{ELSEWHERE}'", where=changes[ELSEWHERE].where, hint=hint)
    return changes


def levels_at(said: Mapping[str, Mapping[str, Any] | None], steps: KeyPath, document: Document) -> list[Level]:
    """Return the levels of the factor that is said at a place of the file.

    Raises:
        PipelineError: no folder can have the name of a level.
    """
    found = []
    for name, changes in said.items():
        where = document.place((*steps, name)).text
        if any(sign in name for sign in "/+\0") or not name.strip(".") or name in FILES:
            raise PipelineError(f"a level can't be called {name!r}: it names folders and columns", where=where)
        found.append(Level(name, changes_at(changes, (*steps, name), document), where))
    return found


def variant_of(levels: Sequence[Level]) -> str:
    """Return the name of the variant that has these levels, one of each factor.

    Raises:
        PipelineError: it is too long for a folder, or a level takes back what that of an earlier factor changes.
    """
    name = "+".join(level.name for level in levels)
    if (size := len(name.encode())) > LONGEST:
        hint = "give the levels shorter names"
        raise PipelineError(f"a variant's name has {size} bytes, more than {LONGEST}", where=levels[0].where, hint=hint)
    for earlier, later in itertools.combinations(levels, 2):
        for (path, old), (other, new) in itertools.product(earlier.changes.items(), later.changes.items()):
            if _within(path, other):
                message = f"'{other}' would take the place of '{path}', which another factor changes at {old.where}"
                hint = f"in '{name}' only one of them would hold; make both levels of one factor"
                raise PipelineError(message, where=new.where, hint=hint)
    return name


def _within(path: str, other: str) -> bool:
    """True where the value at a path is that at another, or in it."""
    path, other = (each.partition(BEFORE)[0] for each in (path, other))
    return f"{path}.".startswith(f"{other}.")
