"""Cache keys: a digest of everything a stage's result depends on, with the readable recipe behind it.

Not in a key: names and order of stages, where to stop (for stages that go on frame by frame), settings marked
`FREE`, output paths, and where files lie; comments, docstrings and layout of code.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from mocapflow.caching.digests import MARK, Digests, digest_array
from mocapflow.errors import PluginError
from mocapflow.registry import Registry
from mocapflow.settings import Component

FORMAT = 3  # of recipes and groups: another number makes everything anew
CODE = frozenset({"format", "core", "code", "reader", "key"})  # entries of a recipe that depend on code
ANEW = "was made anew"
Recipe = Mapping[str, Any]


@dataclass(frozen=True)
class Free:
    """Marks a setting that does not change the result: `keep: Annotated[str, FREE]`."""


FREE = Free()


def key_of(recipe: Recipe) -> str:
    """Return the key of a recipe: 32 hexadecimal digits."""
    text = json.dumps(_unnamed(recipe), sort_keys=True, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def without_code(value: Any) -> Any:
    """Return a recipe without digests of code, and without the keys of its inputs, which have them in them."""
    if isinstance(value, Mapping):
        return {name: without_code(inner) for name, inner in value.items() if name not in CODE}
    return [without_code(inner) for inner in value] if isinstance(value, list | tuple) else value


def component_recipe(component: Component, registry: Registry, digests: Digests) -> dict[str, Any]:
    """Return role, name, code and all settings of a component, nested components the same way."""
    cls = type(component)
    origin = registry.origin(cls)
    return {
        "role": component.role,
        "name": component.name,
        "distribution": origin.distribution if origin.version else "file",
        "code": digests.package(cls.__module__),
        "settings": _settings(component, registry, digests),
    }


def _settings(model: BaseModel, registry: Registry, digests: Digests) -> dict[str, Any]:
    return {
        name: _plain(getattr(model, name), f"{type(model).__name__}.{name}", registry, digests)
        for name, declared in type(model).model_fields.items()
        if not any(isinstance(mark, Free) for mark in declared.metadata)
    }


def _plain(value: Any, where: str, registry: Registry, digests: Digests) -> Any:  # noqa: PLR0911  one line per kind
    if value is None or isinstance(value, bool | int | str) and not isinstance(value, Enum):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else repr(float(value))  # json has no infinity
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Path):
        return digests.file(value, value.name) if value.exists() else f"no file {value.name}"
    if isinstance(value, Component):
        return component_recipe(value, registry, digests)
    if isinstance(value, BaseModel):
        return _settings(value, registry, digests)
    if isinstance(value, np.ndarray):
        return digest_array(value)
    if isinstance(value, Mapping):
        return {str(k): _plain(v, where, registry, digests) for k, v in value.items()}
    if isinstance(value, Sequence):
        return [_plain(v, where, registry, digests) for v in value]
    if isinstance(value, set | frozenset):
        return sorted(json.dumps(_plain(v, where, registry, digests), sort_keys=True) for v in value)
    raise PluginError(f"setting {where} is a {type(value).__name__}, which has no place in a cache key")


def _unnamed(value: Any) -> Any:
    """Return the part of a recipe that counts: digests without their names, for it does not matter where content lies.

    Floats are text: keys of results that are kept have them so.
    """
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str) and value.startswith(MARK):
        return value.partition(" ")[0]
    if isinstance(value, Mapping):
        return {key: _unnamed(v) for key, v in value.items()}
    return [_unnamed(v) for v in value] if isinstance(value, list | tuple) else value


def explain(old: Recipe, new: Recipe) -> str:
    """Return what changed between two recipes, in words: `draper kinematic → xpbd`; the first four changes."""
    changes = all_changes(old, new)
    more = f" and {len(changes) - 4} more" if len(changes) > 4 else ""
    return "; ".join(changes[:4]) + more


def all_changes(old: Recipe, new: Recipe) -> list[str]:
    """Return all that changed between two recipes; inputs that were made anew come after what is of their own."""
    return sorted(dict.fromkeys(_changes(old, new, "")), key=lambda change: change.endswith(ANEW))


def _changes(old: Any, new: Any, path: str) -> Iterator[str]:
    if _unnamed(old) == _unnamed(new):
        return
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        if old.get("role") and old.get("name") != new.get("name"):  # another component: its settings are no news
            yield f"{path or old['role']} {old.get('name')} → {new.get('name')}".strip()
            return
        for name in sorted(old.keys() | new.keys()):
            inner = path if name in {"settings", "component", "inputs"} else f"{path}.{name}".lstrip(".")
            yield from _changes(old.get(name), new.get(name), inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (before, after) in enumerate(zip(old, new, strict=True)):
            yield from _changes(before, after, f"{path}[{index}]")
    else:
        yield _change(old, new, path)


def _change(old: Any, new: Any, path: str) -> str:
    name = next((str(v).partition(" ")[2] for v in (new, old) if str(v).startswith(MARK)), None)
    if name is not None and old is not None and new is not None:
        return f"{name or path} changed"
    if path.endswith(".frames") and isinstance(old, int) and isinstance(new, int):
        return f"{path.removesuffix('.frames')} {'grew' if new > old else 'shrank'} from {old} to {new} frames"
    if path.endswith(".key"):
        return f"{path.removesuffix('.key')} {ANEW}"
    return f"{path} {_words(old)} → {_words(new)}"


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return str(value.get("name", "…"))
    if isinstance(value, list):
        return f"[{', '.join(map(_words, value))}]"
    if isinstance(value, str) and value.startswith(MARK):
        return value.partition(" ")[2] or "given"
    return "none" if value is None else str(value)
