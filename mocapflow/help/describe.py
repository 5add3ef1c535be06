"""Describes components for people: what they do, and each setting with type, default, unit and meaning.

The meaning of a setting is the comment on its line in the source, beside what it explains, or the `description`
of its field.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import tokenize
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from mocapflow.settings import Component

UNITS = {"m": "m", "mm": "mm", "px": "px", "px2": "px²", "deg": "°", "rad": "rad", "s": "s", "hz": "Hz",
         "m_s2": "m/s²", "deg_s2": "°/s²", "px_per_m": "px/m"}  # fmt: skip
PRAGMAS = ("fmt:", "noqa", "type:")  # comments for tools
ENDING = re.compile(rf"_({'|'.join(sorted(UNITS, key=len, reverse=True))})$")


class Setting(NamedTuple):
    """One setting; `name` has the parts of a nested one, as in `steady.turns`."""

    name: str
    type: str
    default: str
    unit: str
    meaning: str


def describe(cls: type[BaseModel]) -> Iterator[str]:
    """Yield the lines that describe a component class."""
    found = list(settings(cls))
    yield from (inspect.getdoc(cls) or "").splitlines()
    yield ""
    yield "settings:" if found else "no settings"
    width = max((len(one.name) for one in found), default=0)
    for one in found:
        default = f" = {one.default}" if one.default else ", required"
        meaning = f"  # {one.meaning}" if one.meaning else ""
        yield f"  {one.name:<{width}}  {one.type}{default}{meaning}"


def settings(cls: type[BaseModel], group: str = "") -> Iterator[Setting]:
    """Yield the settings of a model, those of a group in its place; a default that is empty: it has to be given."""
    meanings = comments(cls)
    for name, field in cls.model_fields.items():
        inner = _group(field.annotation)
        if inner is not field.annotation:
            unit = ENDING.search(name)
            meaning = field.description or meanings.get(name, "")
            kind = _written(field.annotation) + _limits(field.metadata)
            yield Setting(group + name, kind, _default(field), UNITS[unit[1]] if unit else "", meaning)
        if inner is not None:
            yield from settings(inner, f"{group}{name}.")


def comments(cls: type[BaseModel]) -> dict[str, str]:
    """Return the comment written behind each setting in the source of a class and its bases."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            found |= _comments(base)
    return found


def _comments(cls: type[BaseModel]) -> dict[str, str]:
    try:
        source = inspect.cleandoc("\n" + inspect.getsource(cls))
    except (OSError, TypeError):
        return {}
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    said = {token.start[0]: token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT}
    said = {line: text for line, text in said.items() if not text.startswith(PRAGMAS)}
    body = ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    found = {}
    for node in body.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = said.get(node.lineno) or said.get(node.end_lineno or 0, "")
    return found


def _group(annotation: Any) -> type[BaseModel] | None:
    """Return the model, other than a component, that an annotation is or may be."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    groups = [kind for kind in kinds if issubclass(kind, BaseModel) and not issubclass(kind, Component)]
    return groups[0] if groups else None


def _written(annotation: Any) -> str:
    """Return a type as people read it: limits in words, choices without ceremony."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner = [mark for part in parts[1:] for mark in getattr(part, "metadata", [part])]
        return _written(parts[0]) + _limits(inner)
    if origin is Literal:
        return " | ".join(map(repr, parts))
    if origin in {Union, UnionType}:
        return " | ".join("null" if part is NoneType else _written(part) for part in parts)
    if isinstance(annotation, type) and issubclass(annotation, Component):
        return str(getattr(annotation, "name", annotation.role))
    if parts:
        inner = [_written(part) for part in parts if part is not Ellipsis]
        return f"{origin.__name__} of {(' to ' if origin is dict else ', ').join(inner)}"
    return str(getattr(annotation, "__name__", annotation))


def _limits(metadata: Iterable[Any]) -> str:
    """Return the limits among the marks of a setting; `>= 0` as `(≥ 0)`."""
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤", "min_length": "at least", "multiple_of": "multiple of"}
    said = [f"{sign} {getattr(mark, name)}" for mark in metadata for name, sign in signs.items() if hasattr(mark, name)]
    return f" ({', '.join(said)})" if said else ""


def _default(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        return ""
    if isinstance(default, Component):
        given = [f", {name}: {getattr(default, name)}" for name in sorted(default.model_fields_set)]
        return f"{{use: {default.name}{''.join(given)}}}" if given else default.name
    if isinstance(default, Path):
        return default.name
    return "null" if default is None else repr(default)
