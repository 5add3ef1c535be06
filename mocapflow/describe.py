"""Describes a component for people: what it does, and each setting with type, default and meaning."""

from __future__ import annotations

import inspect
import io
import re
import tokenize
from collections.abc import Iterator

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
    annotation = field.annotation
    text = (
        annotation.__name__ if isinstance(annotation, type) and not hasattr(annotation, "__args__") else str(annotation)
    )
    text = re.sub(r"\b[a-z_]\w*(\.[a-z_]\w*)*\.(?=[A-Z])", "", text)
    limits = [str(mark) for mark in field.metadata]
    return f"{text} ({', '.join(map(_limit, limits))})" if limits else text


def _limit(mark: str) -> str:
    signs = {"Gt(gt=": "> ", "Ge(ge=": "≥ ", "Lt(lt=": "< ", "Le(le=": "≤ "}
    for written, sign in signs.items():
        if mark.startswith(written):
            return sign + mark[len(written) : -1]
    return mark


def _default(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        return ", required"
    return f" = {default!r}"
