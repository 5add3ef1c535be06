"""Source code as cache keys see it: the units it is digested in, their files, what they mean and import."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path

INSTALLED = {"site-packages", "dist-packages"}  # folders of what does not change but with its version
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
SHARED = ("io", "recordings.freezing", "recordings.recording")  # counted where a component imports them


def meaning(tree: ast.Module) -> str:
    """Return the syntax tree as text, without docstrings: comments, documentation and layout are free."""
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False):
            node.body = node.body[1:]
    return ast.dump(tree)


def imports(tree: ast.Module) -> Iterator[str]:
    """Yield the dotted names of what a module imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            if node.module.partition(".")[0] == "mocapflow":  # a name may be a module of it
                yield from (f"{node.module}.{alias.name}" for alias in node.names)


def counts(name: str) -> bool:
    """True for an import whose code a component depends on besides the core's."""
    return name.startswith("mocapflow_") or _shared(name) is not None or _uninstalled(name)


def unit_of(module: str) -> str:
    """Return what is digested as one: the top package, or one part of mocapflow itself."""
    parts = module.split(".")
    return _shared(module) or ".".join(parts[:2] if parts[0] == "mocapflow" else parts[:1])


def _shared(name: str) -> str | None:
    """Return the shared part of mocapflow that a name is in."""
    units = (f"mocapflow.{part}" for part in SHARED)
    return next((unit for unit in units if f"{name}.".startswith(f"{unit}.")), None)


def visible(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder in order, without those that file browsers and editors leave there.

    Linked folders count like others: who reads the files does not see the difference.
    """
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name == "Thumbs.db":
            continue
        if path.is_file():
            yield path
        elif path.is_dir() and not folder.resolve().is_relative_to(path.resolve()):  # else it is a link back
            yield from visible(path)


def data_files(unit: str) -> Iterable[tuple[str, Path]]:
    """Yield the files of a plugin package that are no code, such as a template body."""
    if unit.startswith("mocapflow."):
        return
    for inner, path in _inside(unit):
        if path.suffix != ".py" and "__pycache__" not in path.parts:
            yield inner.as_posix(), path


def python_files(unit: str) -> Iterable[tuple[str, Path]]:
    """Yield dotted name and path of every Python file of a module or package."""
    for inner, path in _inside(unit):
        if path.suffix == ".py":
            yield ".".join((unit, *(part for part in inner.with_suffix("").parts if part != "__init__"))), path
    if (file := _file(unit)) is not None:
        placeless = unit if "." in unit else file.stem  # a plugin file's name says where it lies
        yield placeless, file


def _uninstalled(name: str) -> bool:
    """True for a module of the author's own: its code may change, and its version does not tell."""
    top = name.partition(".")[0]
    if top == "mocapflow" or top in sys.stdlib_module_names:
        return False
    file = _file(top)
    places = _folders(top) if file is None else [file] if file.suffix == ".py" else []
    return any(not INSTALLED & set(place.parts) for place in places)


def _inside(unit: str) -> Iterator[tuple[Path, Path]]:
    """Yield the files of a package, within it and in full."""
    for folder in reversed(_folders(unit)):  # who keeps one of each name keeps that of the first folder, as imports do
        yield from ((path.relative_to(folder), path) for path in visible(folder))


def _file(unit: str) -> Path | None:
    """Return the file of a module that is no package."""
    spec = _spec(unit)
    if spec is None or spec.origin is None or spec.submodule_search_locations is not None:
        return None
    return Path(spec.origin)


def _folders(unit: str) -> list[Path]:
    """Return the folders of a package: without an `__init__.py` it may have several."""
    spec = _spec(unit)
    found = None if spec is None else spec.submodule_search_locations
    return [folder for folder in map(Path, found or ()) if folder.is_dir()]  # setuptools adds a name that is no folder


def _spec(unit: str) -> ModuleSpec | None:
    loaded = sys.modules.get(unit)
    return loaded.__spec__ if loaded is not None else importlib.util.find_spec(unit)
