"""Copies of artifacts at a URL: whatever fsspec can reach, object stores included.

Every copy is a group of its own, plain zarr v3, whose `zarr.json` is written last: it is seen whole or not at all,
and no two runs write the same one. Nothing here needs a lock, and there is none: of equal copies one stays.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mocapflow.errors import MocapflowError, StoreError
from mocapflow.storage.artifacts import SHORT
from mocapflow.storage.rows import group_meta

META = "zarr.json"


@dataclass(frozen=True)
class Copy:
    """A copy and the attributes of its artifact."""

    name: str  # of the artifact's group, the key included, and what sets this copy apart from others
    attributes: Mapping[str, Any]

    @property
    def group(self) -> str:
        """What the artifact's group is called in a store."""
        return self.name.rpartition("-")[0]


class Copies:
    """A place for copies.

    Raises:
        StoreError: here and in all methods: the URL can't be reached.
        MocapflowError: there is no such kind of URL, or it needs a package that is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        with self._reaching():
            from fsspec.core import url_to_fs

            # elsewhere there are no folders
            local = {"auto_mkdir": True} if url.startswith(("file:", "local:")) else {}
            try:
                self._files, root = url_to_fs(url, **local)
            except ValueError as error:  # no such protocol
                raise MocapflowError(f"no store can be at {url}: {error}") from error
        self._root = root.rstrip("/")

    def find(self, key: str) -> Copy | None:
        """Return the copy of the artifact made under a key that is furthest."""
        with self._reaching():
            return max(self._copies_of(key), key=_rank, default=None)

    def fetch(self, copy: Copy, path: Path) -> None:
        """Bring a copy to a folder that is not there yet; without `zarr.json` a part of it, for others may drop it."""
        source = f"{self._root}/{copy.name}/"
        with self._reaching(), suppress(FileNotFoundError):  # dropped meanwhile
            found = [file for file in self._files.find(source) if file != source + META]
            targets = [path / file.removeprefix(source) for file in found]
            for folder in {path, *(target.parent for target in targets)}:
                folder.mkdir(parents=True, exist_ok=True)
            self._files.get(found, [str(target) for target in targets])
            self._files.get_file(source + META, str(path / META))  # last, for `_drop` removes it first

    def send(self, path: Path) -> None:
        """Make a copy of a group; of all there are, the furthest stays."""
        target = f"{self._root}/{path.name}-{uuid.uuid4().hex[:8]}"
        parts = [file for file in sorted(path.rglob("*")) if file.is_file() and file != path / META]
        with self._reaching():
            self._files.put(
                [str(part) for part in parts], [f"{target}/{part.relative_to(path).as_posix()}" for part in parts]
            )
            content = (path / META).read_bytes()
            self._files.pipe_file(f"{self._root}/{META}", json.dumps(group_meta({})).encode())
            self._files.pipe_file(f"{target}/{META}", content)
            for other in sorted(self._copies_of(json.loads(content)["attributes"]["key"]), key=_rank)[:-1]:
                self._drop(other)

    def remove(self, key: str) -> None:
        """Remove all copies of an artifact, named by its key or the beginning of that."""
        with self._reaching():
            for copy in self._copies_of(key):
                self._drop(copy)

    def _copies_of(self, key: str) -> list[Copy]:
        self._files.invalidate_cache()
        if not self._files.isdir(self._root):
            return []
        names = [Path(path).name for path in self._files.ls(self._root, detail=False)]
        copies = [self._open(name) for name in names if f"-{key[:SHORT]}-" in name]
        return [copy for copy in copies if copy is not None and str(copy.attributes.get("key")).startswith(key)]

    def _open(self, name: str) -> Copy | None:
        try:
            return Copy(name, json.loads(self._files.cat_file(f"{self._root}/{name}/{META}"))["attributes"])
        except (FileNotFoundError, ValueError, KeyError, TypeError):
            return None  # on its way here, or on its way out

    def _drop(self, copy: Copy) -> None:
        with suppress(FileNotFoundError):  # somebody else was quicker
            self._files.rm(f"{self._root}/{copy.name}/{META}")  # first, so that what is half removed never looks whole
            self._files.rm(f"{self._root}/{copy.name}", recursive=True)

    @contextmanager
    def _reaching(self) -> Iterator[None]:
        try:
            yield
        except MocapflowError:
            raise
        except ImportError as error:
            hint = "pip install 'mocapflow[remote]', and what fsspec names for this kind of URL"
            raise MocapflowError(f"a store at {self.url} needs a package: {error}", hint=hint) from error
        except Exception as error:  # every kind of store has its own
            hint = "without --store the results are kept in a folder beside the run"
            message = f"can't reach the store at {self.url}: {type(error).__name__}: {error}"
            raise StoreError(message, hint=hint) from error


def further(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """True where the first of two attributes of the same artifact has more of it."""
    return _progress(one) > _progress(other)


def _progress(attributes: Mapping[str, Any]) -> tuple[int, bool]:
    return int(attributes.get("frames_done", 0)), bool(attributes.get("complete", False))


def _rank(copy: Copy) -> tuple[tuple[int, bool], str]:
    """Return a key by which any two copies are told apart, so that of equal ones all runs keep the same."""
    return _progress(copy.attributes), copy.name
