"""Digests of files by content and of code by meaning: what cache keys are made of."""

from __future__ import annotations

import ast
import hashlib
import json
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy.typing as npt

from mocapflow.caching import sources
from mocapflow.errors import PluginError, RecordingError
from mocapflow.io.atomic import atomic_write

PARSER = threading.Lock()  # CPython 3.11 counts the parser's recursion across threads (python/cpython#106905)
MARK = "blake2b:"  # a digest reads "blake2b:<hex> <name>"; the name is for people and never counts

CORE = (
    "assets",
    "components",
    "data",
    "dressing.guards",
    "dressing.pieces",
    "dressing.roles",
    "dressing.tailor",
    "functional",
    "geometry",
    "guards.outputs",
    "knocks",
    "loop",
    "model",
    "output_checks",
    "periodic",
    "pooling",
    "prediction",
    "records",
    "results",
    "scene",
    "series",
    "steady",
    "track",
)
LOADED: dict[str, tuple[ModuleSpec, str]] = {}  # loaded modules, each with its code when this process first looked
PYTHON = f" {sys.version_info.major}.{sys.version_info.minor}"  # syntax trees differ between minor versions


def digest(data: bytes | memoryview, name: str = "") -> str:
    """Return the digest of bytes, labelled for people."""
    return f"{MARK}{hashlib.blake2b(data, digest_size=16).hexdigest()} {name}".rstrip()


def digest_array(values: npt.NDArray[Any]) -> str:
    """Return the digest of an array: dtype, shape and content."""
    head = f"{values.dtype.str}{values.shape}".encode()
    return digest(head + values.tobytes())


class Digests:
    """Digests of files and of packages, remembered by path, size and times of change.

    Args:
        memory: where to remember them between runs; None forgets them.
    """

    def __init__(self, memory: Path | None = None) -> None:
        self._memory = memory
        reader = Path(sources.__file__).stat()  # what it finds in a file is remembered, too
        self._reader = f"{PYTHON} {reader.st_size} {reader.st_mtime_ns}"
        self._known: dict[str, list[Any]] = _read(memory)  # path -> stamp, then what was found
        self._packages: dict[str, str] = {}
        self._inputs: dict[Path, tuple[list[int], str]] = {}  # what `file` was asked for: stamp, digest

    def file(self, path: Path, name: str = "") -> str:
        """Return the digest of a file's content, or of all visible files in a folder with their names."""
        stamp = _stamp(path)
        if path.is_dir():
            inside = (f"{p.relative_to(path)} {self._content(p)}" for p in sources.visible(path))
            found = digest("\n".join(inside).encode())
        else:
            found = f"{MARK}{self._content(path)}"
        self._inputs[path] = stamp, found
        return f"{found} {name}".rstrip()

    def check_inputs(self) -> None:
        """Check that files are as they were when `file` was asked for them, and that folders still list the same.

        Raises:
            RecordingError: one is not.
        """
        for path, (stamp, before) in [*self._inputs.items()]:
            if _stamp(path) != stamp and self.file(path) != before:
                hint = "nothing of what it is now is kept; run the same command again"
                raise RecordingError("this has changed since the run began", where=str(path), hint=hint)

    def save(self) -> None:
        """Remember the digests for the next run; where the folder can't be written, they are computed again."""
        if self._memory is None or self._known == _read(self._memory):
            return
        with suppress(OSError), atomic_write(self._memory) as part:
            part.write_text(json.dumps(self._known))

    def package(self, module: str) -> str:
        """Return the digest of a component's top package with the shared modules and plugins it imports."""
        unit = sources.unit_of(module)
        if unit not in self._packages:
            self._packages[unit] = self._package(unit)
        return self._packages[unit]

    def _package(self, first: str) -> str:
        found: dict[str, str] = {}
        open_modules = {first}
        while open_modules:
            unit = open_modules.pop()
            files = {name: self._loaded(name, path) for name, path in sources.python_files(unit)}
            found.update({name: code for name, (code, _) in files.items()})
            found.update({f"{unit}/{name}": self._content(path) for name, path in sources.data_files(unit)})
            imported = {name for _, imports in files.values() for name in imports}
            wanted = {sources.unit_of(name) for name in imported if sources.counts(name)}
            open_modules |= {w for w in wanted if not any(name == w or name.startswith(w + ".") for name in found)}
        return digest(json.dumps(found, sort_keys=True).encode(), f"code of {first}")

    def core(self) -> str:
        """Return the digest of the framework code that every result depends on."""
        found = {
            name: self._loaded(name, path)[0]
            for part in CORE
            for name, path in sources.python_files(f"mocapflow.{part}")
        }
        return digest(json.dumps(found, sort_keys=True).encode(), "code of mocapflow")

    def _content(self, path: Path) -> str:
        def read() -> list[str]:
            with path.open("rb") as file:
                return [hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()]

        try:
            return str(self._remembered(path, "", read)[0])
        except OSError as error:
            raise RecordingError(f"can't be read: {error.strerror}", where=str(path)) from error

    def _loaded(self, name: str, path: Path) -> tuple[str, list[str]]:
        """Return `_source` of a module, if that is what runs: else old code would make results under a new key.

        Raises:
            PluginError: the file has changed since this process, such as a worker that stays, has loaded it.
        """
        code, imports = self._source(path)
        spec = getattr(sys.modules.get(name), "__spec__", None)
        if spec is not None and spec.origin == str(path):
            loaded, before = LOADED.setdefault(name, (spec, code))
            if loaded is not spec:  # reloaded
                LOADED[name] = spec, code
            elif before != code:
                hint = "start this program again; with --scheduler, the workers"
                raise PluginError("this code has changed since it was loaded", where=str(path), hint=hint)
        return code, imports

    def _source(self, path: Path) -> tuple[str, list[str]]:
        def read() -> list[Any]:
            with PARSER:
                tree = ast.parse(path.read_bytes())
            imports = sorted(set(sources.imports(tree)))  # before `meaning`, which cuts the tree
            return [hashlib.blake2b(sources.meaning(tree).encode(), digest_size=16).hexdigest(), imports]

        code, imports = self._remembered(path, self._reader, read)
        return code, imports

    def _remembered(self, path: Path, kind: str, read: Callable[[], list[Any]]) -> list[Any]:
        stamp, name = _stamp(path), f"{path.resolve()}{kind}"
        known = self._known.get(name)
        if known is None or known[:3] != stamp:
            known = self._known[name] = [*stamp, *read()]
        return known[3:]


def _stamp(path: Path) -> list[int]:
    try:
        stat = path.stat()
    except OSError:
        return []
    return [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns]  # tools that copy set the second, nobody the third


def _read(memory: Path | None) -> dict[str, list[Any]]:
    try:
        known = json.loads(memory.read_text()) if memory else {}
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}
