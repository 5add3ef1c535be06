"""A store whose results are shared over the net: a folder to work in, with copies at a URL.

Locks, commits frame by frame and exact resuming need a file system; object stores have none of it. So a run works in
its own folder as ever, fetches what it finds at the URL, and sends there what it has made: results that are finished,
and the frames of a track when the run stops. What has to be shared frame by frame, and made only once, belongs in a
folder that all machines mount: the locks hold there.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mocapflow.errors import StoreError
from mocapflow.records import silent
from mocapflow.storage.artifacts import SHORT, Artifact, writing
from mocapflow.storage.copies import META, Copies, Copy, further
from mocapflow.storage.locks import Lock
from mocapflow.storage.rows import Corrupted, flush_all
from mocapflow.storage.store import ASIDE, Report, Store


def open_store(path: Path, url: str | None) -> Store:
    """Return the store of a folder; with a URL, one whose results are shared there."""
    return Store(path) if url is None else SharedStore(path, Copies(url))


class SharedStore(Store):
    """A folder of artifacts with copies at a URL."""

    def __init__(self, path: Path, copies: Copies) -> None:
        super().__init__(path)
        self._copies = copies
        self._fetched: set[str] = set()  # the beginnings of keys of which what is here, or was, is a copy
        self._writing: set[str] = set()  # keys this process has the right to write: what is here counts, and is fetched

    def find(self, key: str) -> Artifact | None:
        """Return the artifact made under a key, here or at the URL: whichever is further."""
        here = super().find(key)
        if key in self._writing or (here is not None and here.complete and not here.frames):
            return here
        there = self._ahead(key, here)
        return here if there is None else Artifact(self.path / there.group, there.attributes)

    def load(self, artifact: Artifact, frames: int | None = None) -> Any:
        """Return the record of an artifact, fetched first if it is not here; see `Store.load`."""
        if self._is_further(artifact):
            with super().writer(artifact.key, artifact.path.name, silent):
                self._fetch(artifact.key)
            if self._is_further(artifact):
                raise Corrupted(f"the copy of {artifact.path.name} is gone")
        return super().load(artifact, frames)

    def _is_further(self, artifact: Artifact) -> bool:
        here = super().find(artifact.key)
        return here is None or further(artifact.attributes, here.attributes)

    @contextmanager
    def writer(self, key: str, name: str, report: Report) -> Iterator[Lock]:
        """Hold the right to write the artifact of a key in this folder; what was made is sent to the URL at the end."""
        with super().writer(key, name, report) as lock:
            self._fetch(key)
            self._writing.add(key)
            try:
                yield lock
            except BaseException:
                try:
                    self._send(key)
                except StoreError as error:  # all is saved here, and why the run ends matters more
                    report(f"warning: {error.message}")
                raise
            finally:
                self._writing.discard(key)
            self._send(key)

    def set_aside(self, path: Path) -> Path:
        """Move a damaged group out of the way; its copy takes its place, unless the group was one: then copies go."""
        aside, key = super().set_aside(path), path.name.rpartition("-")[2]
        if key in self._fetched:
            self._copies.remove(key)
            self._fetched.discard(key)
        else:
            self._fetch(key)
        return aside

    def discard(self, artifact: Artifact) -> None:
        """Remove an artifact that is to be made anew, with its copies: they would be taken for further than the new."""
        self._copies.remove(artifact.key)
        super().discard(artifact)

    def _ahead(self, key: str, here: Artifact | None) -> Copy | None:
        """Return the copy at the URL, if it is further than what is here."""
        there = self._copies.find(key)
        behind = there is None or (here is not None and not further(there.attributes, here.attributes))
        return None if behind else there

    def _fetch(self, key: str) -> None:
        """Bring the furthest copy here, if it is further; only with the right to write."""
        there = self._ahead(key, super().find(key))
        if there is None:
            return
        part = self.state / f"{ASIDE}{there.group}"  # `cache prune` removes what a run leaves here that is killed
        shutil.rmtree(part, ignore_errors=True)
        try:
            self._copies.fetch(there, part)
            if not (part / META).is_file():  # dropped meanwhile for one that is further: what is here stays
                return
            with writing(self.path):
                flush_all(part)
                self.clear(key)
                part.rename(self.path / there.group)
                self._fetched.add(key[:SHORT])
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def _send(self, key: str) -> None:
        here, there = super().find(key), self._copies.find(key)
        if here is None or not (here.complete or here.frames):
            return
        if there is None or further(here.attributes, there.attributes):
            self._copies.send(here.path)
