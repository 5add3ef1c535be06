"""What a plugin has to be: importable, with known hooks, providing classes that can play their role."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from mocapflow import hookspecs
from mocapflow.components import Stage
from mocapflow.errors import PluginError, guess
from mocapflow.settings import Component


def import_file(path: Path) -> ModuleType:
    """Import a plugin from a Python file, each file under a name of its own.

    Raises:
        PluginError: there is no such file, or it is not Python; what the file itself raises is passed on.
    """
    if not path.is_file():
        raise PluginError(f"there is no file {path}")
    name = f"mocapflow_file_{path.stem}_{hashlib.blake2b(str(path.resolve()).encode(), digest_size=4).hexdigest()}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise PluginError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic and typing look annotations up there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def check_hooks(plugin: Any) -> None:
    """Check that a plugin's hooks exist and are marked as such.

    Raises:
        PluginError: a hook is unknown, a function that has the name of one is not marked, or there is none.
    """
    known = {name for name in vars(hookspecs) if name.startswith("mocapflow_")}
    marks = []
    for name, function in inspect.getmembers(plugin, inspect.isroutine):
        marked = getattr(function, "mocapflow_impl", None)
        marks += [marked] if marked else []
        hook = (marked or {}).get("specname") or name
        if marked and hook not in known:
            raise PluginError(" — ".join(filter(None, [f"unknown hook '{hook}'", guess(hook, known)])))
        if name in known and not marked:
            raise PluginError(f"{name} lacks @mocapflow.hookimpl")
    if not marks:
        raise PluginError("it has no hook, such as mocapflow_priors, that returns its components")


def vetted(answer: Any, base: type[Component], hook: str) -> list[type[Component]]:
    """Return the classes that a hook has answered with, if all of them can play the role `base`.

    Raises:
        PluginError: it is no list, or one of them has another base, no name, or lacks a method.
    """
    if isinstance(answer, type) or not isinstance(answer, Iterable):
        raise PluginError(f"{hook} returned {getattr(answer, '__name__', answer)}, not a list of classes")
    return [_checked(cls, base, hook) for cls in answer]


def _checked(cls: Any, base: type[Component], hook: str) -> type[Component]:
    if isinstance(cls, base):
        label = type(cls).__name__
        raise PluginError(f"{hook} returned an instance of {label}: return the class, {label} without ()")
    label = getattr(cls, "__name__", repr(cls))
    if not (isinstance(cls, type) and issubclass(cls, base)):
        raise PluginError(f"{hook} returned {label}, which is not a {base.__name__}")
    if "name" in cls.model_fields:
        raise PluginError(f'{base.__name__} {label} has its name as a setting: write `name = "..."`, without a type')
    if not isinstance(getattr(cls, "name", None), str):
        raise PluginError(f'{base.__name__} {label} has no name: write `name = "..."` in the class')
    missing = set(getattr(cls, "__abstractmethods__", ()))
    if base is Stage and not hasattr(cls, "run"):
        missing.add("run")
    if missing:
        raise PluginError(f"{base.__name__} {label} does not define {', '.join(sorted(missing))}")
    for verb in getattr(base, "__abstractmethods__", ()):
        asked = list(inspect.signature(getattr(base, verb)).parameters)
        try:
            inspect.signature(getattr(cls, verb)).bind(*asked)
        except TypeError:
            raise PluginError(f"{base.__name__} {label}: {verb} has to take ({', '.join(asked)})") from None
    return cls
