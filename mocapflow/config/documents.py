"""Values of a file with the place of each, and changes of them by dotted paths."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mocapflow.errors import PipelineError, alternatives

KeyPath = tuple[str | int, ...]  # the way to a value: keys of mappings, indices of lists
GROUPS = {"frames", "parts"}  # of plain settings, which a file may leave out
STAGES: KeyPath = ("stages",)  # names in there are free: a wrong one would be a new one
BEFORE = " before "  # between a path and the name that its value is put before


@dataclass(frozen=True)
class Place:
    """Where a value was written; relative paths in it start at `folder`."""

    text: str  # file:line:column, or the option of the command line
    folder: Path


@dataclass(frozen=True)
class Document:
    """The values of a file with the place of each."""

    values: dict[str, Any]
    places: Mapping[KeyPath, Place]

    def place(self, steps: KeyPath) -> Place:
        """Return where a value stands, or what a change has put in it, or the nearest one that contains it."""
        inside = (place for at, place in self.places.items() if at[: len(steps)] == steps)
        if steps not in self.places and (found := next(inside, None)):
            return found
        while steps not in self.places:
            steps = steps[:-1]
        return self.places[steps]


def dotted(steps: KeyPath) -> str:
    """Return the path of a value as people write it."""
    return ".".join(map(str, steps))


def changed(document: Document, target: str, new: Document) -> Document:
    """Return the document with the value at a dotted path replaced.

    Args:
        document: as it was; it is left alone.
        target: the path, as `stages.track.draper`, or with its place: `stages.corrupt before background`. What is in a
            list is named, `stages.track.priors.parzen`, or numbered from 0; a component of that name is added to it.
        new: the value, and where it was written.

    Raises:
        PipelineError: the document has no such path; with the place of the new value.
    """
    path, _, successor = target.partition(BEFORE)
    where = new.place(()).text
    values = deepcopy(document.values)
    holder, steps = _holder_of(values, path.split("."), new.values, where)
    key, siblings = steps[-1], steps[:-1]
    if new.values is None and siblings == STAGES and isinstance(holder, dict) and key not in holder:
        hint = alternatives(str(key), holder)
        raise PipelineError(f"there is no '{dotted(steps)}' to leave out", where=where, hint=hint)
    holder[key] = new.values
    if successor and not _moved(holder, key, successor):
        message = f"there is no '{dotted((*siblings, successor))}' to put '{key}' before"
        raise PipelineError(message, where=where, hint=alternatives(successor, map(str, holder)))
    kept = {at: place for at, place in document.places.items() if at[: len(steps)] != steps}
    return Document(values, {**kept, **{(*steps, *at): place for at, place in new.places.items()}})


def _holder_of(values: Any, parts: list[str], value: Any, where: str) -> tuple[Any, KeyPath]:
    """Return the mapping or list that holds the value at a path, opened to be written into, and the way to the value.

    A list is made longer by one where the path names what it lacks, and the value is a component of that name.

    Raises:
        PipelineError: there is no such path.
    """
    holder = values
    steps: KeyPath = ()
    for part in parts:
        if steps:
            holder = _opened(holder, steps[-1])
        last = len(steps) == len(parts) - 1
        if last and isinstance(holder, list) and part == _name(value) and part not in map(_name, holder):
            holder.append(None)
            return holder, (*steps, len(holder) - 1)
        key = _entry(holder, part) if isinstance(holder, list) else part
        if not _may_hold(holder, key, last):
            known = _entries(holder) if isinstance(holder, list) else holder if isinstance(holder, dict) else ()
            message = f"there is no '{dotted((*steps, part))}'"
            raise PipelineError(message, where=where, hint=alternatives(part, known))
        steps = (*steps, key)
    return holder, steps


def _entry(entries: list[Any], part: str) -> str | int:
    """Return the index of the entry that a part of a path means, the part itself if it means none."""
    if part.isdecimal():
        return int(part)
    names = _entries(entries)
    return names.index(part) if part in names else part


def _entries(entries: list[Any]) -> list[str]:
    """Return how a path may name the entries of a list: components by names that no other has, others by indices."""
    names = [_name(entry) for entry in entries]
    return [name if isinstance(name, str) and names.count(name) == 1 else str(k) for k, name in enumerate(names)]


def _name(entry: Any) -> Any:
    """Return the name of a component as a file writes it; anything else as it is."""
    return entry.get("use") if isinstance(entry, dict) else entry


def _moved(holder: Any, key: str | int, successor: str) -> bool:
    """Put a key right before another of its mapping, in place; False where there is no such place."""
    if not isinstance(holder, dict) or key == successor or successor not in holder:
        return False
    names = [name for name in holder if name != key]
    for name in (key, *names[names.index(successor) :]):
        holder[name] = holder.pop(name)
    return True


def _opened(holder: Any, key: str | int) -> Any:
    """Return the value of a key, to be written into: a bare name gets settings, a group left out is made."""
    value = holder.get(key, {}) if isinstance(holder, dict) else holder[key]
    holder[key] = {"use": value} if isinstance(value, str) else value
    return holder[key]


def _may_hold(holder: Any, key: str | int, last: bool) -> bool:
    """True where a path can go on at a key: it is there, or may be new as a setting of a component."""
    if isinstance(holder, list):
        return isinstance(key, int) and key < len(holder)
    return isinstance(holder, dict) and (key in holder or last or "use" in holder or key in GROUPS)
