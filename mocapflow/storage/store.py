"""Artifacts in a zarr folder: one group per result, named `<stage>-<key>`, with the recipe it was made by.

A group counts as finished only by its attribute `complete`, never by which chunks exist: a missing chunk reads as
the fill value.

What is no result lies in `.state`: locks, digests, groups that were damaged. To zarr it is an empty array, for zarr and
xarray look into every group and complain of what they don't know, but never into an array. It is not beside the store:
whoever shares the folder has to share the locks.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.caching.digests import Digests
from mocapflow.caching.keys import Recipe
from mocapflow.errors import MocapflowError, StoreError
from mocapflow.storage.artifacts import SHORT, Artifact, open_artifact, remove, versions, writing
from mocapflow.storage.locks import Lock, acquire, looking
from mocapflow.storage.rows import Corrupted, array_meta, flush_all, group_meta, read_json, write_json

GROUP = re.compile(rf"[\w-]+-[0-9a-f]{{{SHORT}}}")  # names of groups: label and key
ASIDE = "damaged-"  # begins the name, in `.state`, of a group that is no use any more
Report = Callable[[str], None]


class Store:
    """A folder of artifacts."""

    def __init__(self, path: Path) -> None:
        if ":/" in str(path):
            hint = "a URL is for --store of run, plan and compare"
            raise MocapflowError(f"the store has to be a folder, not {str(path).replace(':/', '://')}", hint=hint)
        self.path = path
        self.state = path / ".state"  # what is no result
        self.digests = Digests(self.state / "digests.json")

    def create(self) -> None:
        """Make the folder, if there is none.

        Raises:
            StoreError: it can't be written.
            MocapflowError: it holds files of others.
        """
        if strangers := self._strangers():
            hint = f"give stored results a folder of their own: --store {self.path / 'store.zarr'}"
            raise MocapflowError(f"this folder is no store: it holds {strangers[0]}", where=str(self.path), hint=hint)
        about = {"unit": "1", "about": "locks, digests and damaged results of mocapflow; no data"}
        state = array_meta((0,), (1,), np.dtype(np.uint8), 0, ("nothing",), about)
        with writing(self.path):
            for folder, meta in ((self.path, group_meta({})), (self.state, state)):
                folder.mkdir(parents=True, exist_ok=True)
                if _kind(folder) != meta["node_type"]:  # not there yet, or damaged
                    write_json(folder / "zarr.json", meta)

    def _strangers(self) -> list[str]:
        """Return the files that lie in a folder that is no store; among folders there may be one of runs."""
        files = sorted(path.name for path in self.path.glob("[!.]*") if path.is_file())
        return [] if "zarr.json" in files or self.state.exists() else files

    def artifacts(self) -> list[Artifact]:
        """Return what is in the store, oldest first; what can't be read is left out."""
        return sorted(self._found("*"), key=lambda a: str(a.attributes.get("created", "")))

    def find(self, key: str) -> Artifact | None:
        """Return the artifact made under a key, finished or not."""
        return next((a for a in self._found(f"*-{key[:SHORT]}") if a.key == key), None)

    def nearest(self, label: str, recipe: Recipe, but: str) -> Artifact | None:
        """Return the newest artifact of the same stage with another key, to say what is different now."""
        name = recipe["component"]["name"]
        others = [a for a in self.artifacts() if a.key != but]
        alike = [a for a in others if a.recipe.get("component", {}).get("name") == name]
        labelled = [a for a in alike if a.path.name.rpartition("-")[0] == label]
        return next(reversed(labelled or alike), None)

    @contextmanager
    def writer(self, key: str, name: str, report: Report) -> Iterator[Lock]:
        """Hold the right to write the artifact of a key; waits for whoever else is writing it."""
        with writing(self.path):
            lock = acquire(self._lock(key), name, report)
        try:
            yield lock
        finally:
            lock.release()

    def busy(self, key: str) -> bool:
        """Return whether a run is writing the artifact of a key."""
        with writing(self.path), looking(self._lock(key)) as busy:
            return busy

    def begin(self, label: str, key: str, recipe: Recipe) -> Artifact:
        """Return a new, unfinished artifact; what stood in its place is removed."""
        self.clear(key)
        path = self.path / f"{label}-{key[:SHORT]}"
        attributes = {
            "key": key, "recipe": recipe, "versions": versions(), "complete": False,
            "created": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        }  # fmt: skip
        with writing(self.path):
            path.mkdir(parents=True)
            write_json(path / "zarr.json", group_meta(attributes))
        return Artifact(path, attributes)

    def clear(self, key: str) -> None:
        """Remove what there is of a key, also what is damaged."""
        for old in self._groups(f"*-{key[:SHORT]}"):
            remove(old)

    def save(self, artifact: Artifact, value: Any, warnings: Sequence[str] = ()) -> None:
        """Write a record into an artifact, with what was said while it was made, and finish it.

        Raises:
            StoreError: the store is full or can't be written.
        """
        import zarr

        from mocapflow.storage.archive import save_record

        with writing(self.path):
            group = zarr.open_group(str(artifact.path), mode="r+")
            save_record(group, value)
            flush_all(artifact.path)
            group.update_attributes({"complete": True, "warnings": list(warnings)})

    def load(self, artifact: Artifact, frames: int | None = None) -> Any:
        """Return the record of an artifact, or the first `frames` rows of it.

        Raises:
            Corrupted: it can't be read back.
        """
        import zarr

        from mocapflow.storage.archive import load_record

        try:
            group = zarr.open_group(str(artifact.path), mode="r")
        except Exception as error:
            raise Corrupted(f"{artifact.path} can't be opened: {error}") from error
        return load_record(group, frames)

    def set_aside(self, path: Path) -> Path:
        """Move a damaged group out of the way and return its new name."""
        aside = self.state / f"{ASIDE}{path.name}-{time.time_ns()}"
        with writing(self.path):
            path.rename(aside)
        return aside

    def drop(self, path: Path) -> bool:
        """Remove a group, if no run is writing it, and return whether it is gone."""
        with writing(self.path), looking(self._lock(path.name.rpartition("-")[2])) as busy:
            kept = busy or not path.exists()  # somebody else may have removed it
            aside = None if kept else self.set_aside(path)  # removing may take long, and others wait
        if aside is not None:
            remove(aside)
        return not busy

    def aside(self) -> list[Path]:
        """Return the groups that were damaged and set aside, and parts of copies whose fetching was cut off."""
        return sorted(self.state.glob(f"{ASIDE}*"))

    def discard(self, artifact: Artifact) -> None:
        """Remove an artifact that is to be made anew."""
        remove(artifact.path)

    def damaged(self, key: str = "") -> list[Path]:
        """Return the groups of which not even the attributes can be read, all or those of a key."""
        return [path for path in self._groups(f"*-{key[:SHORT] or '*'}") if open_artifact(path) is None]

    def _lock(self, key: str) -> Path:
        return self.state / f"{key[:SHORT]}.lock"

    def _found(self, pattern: str) -> Iterator[Artifact]:
        return filter(None, map(open_artifact, self._groups(pattern)))

    def _groups(self, pattern: str) -> list[Path]:
        """Return the groups by their names; other folders, such as a run folder in here, belong to others."""
        return sorted(p for p in self.path.glob(pattern) if p.is_dir() and GROUP.fullmatch(p.name))


def _kind(folder: Path) -> str | None:
    """Return what a zarr node is, None where it can't be read."""
    try:
        return str(read_json(folder / "zarr.json").get("node_type"))
    except StoreError:
        return None
