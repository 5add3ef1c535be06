"""Reads a YAML file and remembers where every value was written; applies `extends`, `change` and `--set`."""

from __future__ import annotations

import os
import re
from collections.abc import Hashable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import yaml

from mocapflow.config.documents import Document, KeyPath, Place, changed, dotted
from mocapflow.errors import PipelineError, alternatives

MOST_VALUES = 100_000  # of a file; aliases of aliases can stand for more than any memory holds
LEADING_ZERO = re.compile(r"[-+]?0[0-9_]")  # 0x10 and 0b10 say themselves what they are
HINTS = {  # by what YAML says
    r"character '\t'": "indent with spaces, not with tabs",
    "unknown escape character": "in double quotes a backslash begins a special character: write paths with / instead",
}


def read(path: Path, changes: Iterable[str] = (), folder: Path = Path()) -> Document:
    """Read a YAML file, the one it extends, and changes `PATH=VALUE` (of the command line) on top.

    Relative paths in changes start at a folder, those in a file at its own.

    Raises:
        PipelineError: no such file, not YAML, or a change of something that is not there.
    """
    document = _read_file(path)
    if "extends" in document.values:
        document = _extended(document, path)
    for change in changes:
        target, equals, text = change.partition("=")
        place = Place(f"--set {change}", folder)
        if not (target and equals):
            raise PipelineError("a change is written PATH=VALUE", where=place.text)
        value = _parse(text, place.text, None)
        document = changed(document, target, Document(value.values, dict.fromkeys(value.places, place)))
    return document


def _read_file(path: Path) -> Document:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        here = [p.name for p in path.parent.glob("[!.]*.y*ml")]
        hint = alternatives(path.name, here) if here else f"{path.parent.absolute()} has no YAML file at all"
        raise PipelineError("there is no such file", where=str(path), hint=hint) from None
    except OSError as error:
        raise PipelineError(f"can't be read: {error.strerror}", where=str(path)) from None
    except UnicodeDecodeError:
        raise PipelineError("is not UTF-8 text", where=str(path)) from None
    document = _parse(text, str(path), path)
    if not isinstance(document.values, dict):
        raise PipelineError("the file should hold `name: value` lines", where=f"{path}:1:1")
    return document


def _parse(text: str, file: str, path: Path | None) -> Document:
    """Return the value of a YAML text; `path` None: a value from the command line, without line numbers."""
    built = _Built(file, path)
    try:
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        value: Any = built.value(node, (), loader) if node else ({} if path else None)
    except yaml.MarkedYAMLError as error:
        where = built.where(error.problem_mark) if error.problem_mark else file
        context = f" ({error.context})" if error.context else ""
        hint = next((hint for sign, hint in HINTS.items() if sign in str(error.problem)), "")
        raise PipelineError(f"not YAML: {error.problem}{context}", where=where, hint=hint) from None
    except RecursionError:
        raise PipelineError("not YAML: values inside of values without an end", where=file) from None
    except yaml.YAMLError as error:
        raise PipelineError(f"not YAML: {str(error).splitlines()[0]}", where=file) from None
    return Document(value, built.places or {(): Place(f"{file}:1:1" if path else file, built.folder)})


class _Built:
    """Values of YAML nodes, and where each was written."""

    def __init__(self, file: str, path: Path | None) -> None:
        self.places: dict[KeyPath, Place] = {}
        self.folder = path.parent if path else Path()
        self._file, self._lines = file, path is not None

    def where(self, mark: yaml.Mark) -> str:
        """Return a place for people."""
        return f"{self._file}:{mark.line + 1}:{mark.column + 1}" if self._lines else self._file

    def value(self, node: yaml.Node, steps: KeyPath, loader: yaml.SafeLoader) -> Any:
        """Return the value of a node, which is found in the document by these steps.

        Raises:
            PipelineError: a name is no text or is written twice, or a value is not what it is tagged as.
        """
        self.places.setdefault(steps, Place(self.where(node.start_mark), self.folder))
        if len(self.places) > MOST_VALUES:
            raise PipelineError(f"holds more than {MOST_VALUES:,} values", where=self.where(node.start_mark))
        if isinstance(node, yaml.MappingNode):
            found: dict[str, Any] = {}
            for named, inner in node.value:
                key = self._key(named, steps, loader)
                found[key] = self.value(inner, (*steps, key), loader)
            return found
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*steps, index), loader) for index, item in enumerate(node.value)]
        return self._plain(node, loader)

    def _key(self, node: yaml.Node, steps: KeyPath, loader: yaml.SafeLoader) -> str:
        key: Hashable = self._plain(node, loader)
        where = self.where(node.start_mark)
        if not isinstance(key, str):
            raise PipelineError(f"a name should be text, not {key!r}: put it in quotes", where=where)
        if (*steps, key) in self.places:
            raise PipelineError(f"'{dotted((*steps, key))}' is written twice", where=where)
        self.places[*steps, key] = Place(where, self.folder)
        return key

    def _plain(self, node: yaml.Node, loader: yaml.SafeLoader) -> Any:
        if _meant_as_text(node):
            return node.value
        try:
            return loader.construct_object(node)
        except (ValueError, LookupError):  # the latter of 'x: !!bool abc'
            kind = node.tag.rpartition(":")[2]
            raise PipelineError(f"not YAML: '{node.value}' is no {kind}", where=self.where(node.start_mark)) from None


def _meant_as_text(node: yaml.Node) -> bool:
    """Return whether YAML 1.1 would read something else than people write: 10:20 as 620, 010 as 8, a date."""
    base_60 = node.tag.endswith((":int", ":float")) and ":" in node.value
    octal = node.tag.endswith(":int") and LEADING_ZERO.match(node.value) is not None
    return base_60 or octal or node.tag.endswith(":timestamp")


def _extended(child: Document, path: Path) -> Document:
    if unknown := set(child.values) - {"extends", "change", "mocapflow"}:
        name = min(unknown)
        misspelt = get_close_matches(name, ("extends", "change"), 1)
        hint = f"did you mean '{misspelt[0]}'?" if misspelt else f"write it as change: {{{name}: ...}}"
        message = f"'{name}' has no place in a file that extends another: only `extends` and `change` do"
        raise PipelineError(message, where=child.place((name,)).text, hint=hint)
    base = _base_of(child, path)
    if "mocapflow" in child.values:
        base = changed(base, "mocapflow", Document(child.values["mocapflow"], _places(child, ("mocapflow",))))
    changes = child.values.get("change") or {}
    if not isinstance(changes, dict):
        raise PipelineError("change: write `path.to.value: new value` lines", where=child.place(("change",)).text)
    for target, value in changes.items():
        base = changed(base, target, Document(value, _places(child, ("change", target))))
    return base


def _base_of(child: Document, path: Path) -> Document:
    """Return the file that another one, at a path, extends."""
    where, named = child.place(("extends",)).text, child.values["extends"]
    if not isinstance(named, str):
        raise PipelineError("extends: name one file", where=where, hint="extends: skirt.yaml")
    extended = Path(os.path.normpath(path.parent / named))
    if extended == Path(os.path.normpath(path)):
        raise PipelineError("the file extends itself", where=where, hint="name the pipeline that it changes")
    try:
        base = _read_file(extended)
    except PipelineError as error:
        if error.where != str(extended):  # a line in there is wrong
            raise
        message = f"extends: {extended}: {error.message}"
        raise PipelineError(message, where=where, hint=error.hint) from None
    if "extends" in base.values:
        message = f"{named} itself extends another file; `extends` goes one level deep"
        root = os.path.normpath(Path(named).parent / str(base.values["extends"]))
        hint = f"extend {root} and copy what is under `change` in {extended.name}"
        if os.path.normpath(path.parent / root) == os.path.normpath(path):
            message, hint = f"{named} extends this file, and this file extends it", "one of them has to say its stages"
        raise PipelineError(message, where=where, hint=hint)
    return base


def _places(document: Document, steps: KeyPath) -> dict[KeyPath, Place]:
    """Return the places of a value and of what is in it, by the way from there."""
    return {at[len(steps) :]: place for at, place in document.places.items() if at[: len(steps)] == steps}
