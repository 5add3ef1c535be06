"""One result in the store: a zarr group, the recipe it was made by, and the versions that have made it."""

from __future__ import annotations

import importlib.metadata
import platform
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mocapflow.caching.keys import Recipe
from mocapflow.errors import FULL, StoreError, folder_error
from mocapflow.storage.rows import read_json

SHORT = 12  # digits of the key in a group's name
LIBRARIES = ("mocapflow", "numpy", "scipy", "opencv-python-headless", "av", "open3d", "numba")


@dataclass(frozen=True)
class Artifact:
    """One group of the store and its attributes."""

    path: Path
    attributes: Mapping[str, Any]

    @property
    def key(self) -> str:
        """The key it was made under."""
        return str(self.attributes.get("key", ""))

    @property
    def recipe(self) -> Recipe:
        """What it was made from."""
        return dict(self.attributes.get("recipe", {}))

    @property
    def complete(self) -> bool:
        """True where it was written to its end."""
        return bool(self.attributes.get("complete", False))

    @property
    def frames(self) -> int:
        """How many frames are committed; 0 for a result that is no chain of frames."""
        done: int = self.attributes.get("frames_done", 0)
        return done

    @property
    def warnings(self) -> list[str]:
        """What was warned of while it was made."""
        return [str(said) for said in self.attributes.get("warnings", [])]

    @property
    def made_with(self) -> list[tuple[int, dict[str, str]]]:
        """With which versions it was made: (count of frames, versions), earliest first."""
        earlier = [(int(count), dict(made)) for count, made in self.attributes.get("earlier_versions", [])]
        return [*earlier, (self.frames, dict(self.attributes.get("versions", {})))]


def open_artifact(path: Path) -> Artifact | None:
    """Return the artifact in a folder; None where there is none, or its description can't be read."""
    try:
        attributes = read_json(path / "zarr.json").get("attributes")
    except StoreError:
        return None
    if not isinstance(attributes, dict) or "key" not in attributes:
        return None
    done = attributes.get("frames_done", 0)
    return Artifact(path, attributes) if type(done) is int and done >= 0 else None  # true is no number of frames


@cache
def versions() -> Mapping[str, str]:
    """Return the versions a result depends on."""
    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = importlib.metadata.version(library)
        except importlib.metadata.PackageNotFoundError:
            found[library] = "not installed"
    return found


def with_versions(artifact: Artifact) -> Artifact:
    """Return a chain as it is when it goes on under the versions of now; the next commit writes them down."""
    now, (count, made) = versions(), artifact.made_with[-1]
    if made == now:
        return artifact
    earlier = [*artifact.attributes.get("earlier_versions", []), [count, made]]
    return Artifact(artifact.path, {**artifact.attributes, "versions": now, "earlier_versions": earlier})


def made_otherwise(artifact: Artifact) -> Iterator[tuple[int, int, str]]:
    """Yield each count of frames from and up to which other versions have made an artifact, and which those were."""
    now, first = versions(), 0
    for last, made in artifact.made_with:
        other = [f"{name} {was}, now {now.get(name)}" for name, was in made.items() if now.get(name) != was]
        if other:
            yield first, last, "; ".join(other)
        first = last


def remove(path: Path) -> None:
    """Remove a group; its attributes go first, so that a half-removed one never looks whole."""
    with writing(path.parent):
        (path / "zarr.json").unlink(missing_ok=True)
        shutil.rmtree(path)


@contextmanager
def writing(where: Path, saved: str = "") -> Iterator[None]:
    """Turn what the system says about writing into an error for people.

    Args:
        where: the store.
        saved: what is kept in spite of the failure.
    """
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            message, todo = f"the store {where} is full", "free some space"
        else:
            message, todo = f"can't write to the store {where}: {error.strerror or error}", "make it writable"
        hint = "\n".join(filter(None, [f"{todo}, or name another store", saved]))
        raise folder_error(error)(message, hint=hint) from error
