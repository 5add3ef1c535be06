"""Describes a component for people: what it does, and each setting with type, default and meaning."""

from __future__ import annotations

import inspect
import io
import re
import tokenize
from collections.abc import Iterable, Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from mocapflow.components import Component


def describe(cls: type[Component]) -> Iterator[str]:
    """Yield the lines that describe a component class."""
    yield from (inspect.getdoc(cls) or "").splitlines()
    yield ""
    yield "settings:" if cls.model_fields else "no settings"
    meanings = comments(cls)
    width = max((len(name) for name in cls.model_fields), default=0)
    for name, field in cls.model_fields.items():
        meaning = field.description or meanings.get(name, "")
        line = f"  {name:<{width}}  {_type(field)}{_default(field)}"
        yield f"{line}  # {meaning}" if meaning else line


def comments(cls: type[BaseModel]) -> dict[str, str]:
    """Return the comment written behind each setting in the source of a class and its bases."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if not issubclass(base, BaseModel) or base is BaseModel:
            continue
        try:
            source = inspect.cleandoc("\n" + inspect.getsource(base))
        except (OSError, TypeError):
            continue
        lines = source.splitlines()
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                named = re.match(r"\s*(\w+)\s*:", lines[token.start[0] - 1])
                if named and named[1] in cls.model_fields:
                    found[named[1]] = token.string.lstrip("# ")
    return found


def _type(field: FieldInfo) -> str:
    return _written(field.annotation) + _limits(field.metadata)


def _written(annotation: Any) -> str:
    """Return a type as people read it: limits in words, choices without ceremony."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner = [mark for part in parts[1:] for mark in getattr(part, "metadata", [part])]
        return _written(parts[0]) + _limits(inner)
    if origin is Literal:
        return " | ".join(map(repr, parts))
    if origin in {Union, UnionType}:
        return " | ".join("none" if part is NoneType else _written(part) for part in parts)
    if parts:
        return f"{origin.__name__} of {', '.join(_written(part) for part in parts if part is not Ellipsis)}"
    return str(getattr(annotation, "__name__", annotation))


def _limits(metadata: Iterable[Any]) -> str:
    """Return the limits among the marks of a setting; `>= 0` as `(≥ 0)`."""
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤", "min_length": "at least", "multiple_of": "multiple of"}
    said = [f"{sign} {getattr(mark, name)}" for mark in metadata for name, sign in signs.items() if hasattr(mark, name)]
    return f" ({', '.join(said)})" if said else ""


def _default(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        return ", required"
    return f" = {'none' if default is None else repr(default)}"
