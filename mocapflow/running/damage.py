"""Damaged results in the store: they are set aside, or written anew from what can still be read, and that is told."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from mocapflow.running.recipes import Step
from mocapflow.storage.artifacts import Artifact
from mocapflow.storage.rows import Corrupted
from mocapflow.storage.store import Report, Store


class Repairs(NamedTuple):
    """Finds what is left of a result, for who holds the right to write it."""

    store: Store
    report: Report

    def readable(self, step: Step) -> Artifact | None:
        """Return what there is of a result; where not even its description can be read, what takes its place."""
        for damaged in self.store.damaged(step.key):
            self.set_aside(step, damaged, Corrupted("its description can't be read"))
        return self.store.find(step.key)

    def mended(self, step: Step, made: Artifact, error: Corrupted) -> Artifact | None:
        """Return what is left of a result that can't be read: of a track its frames, to write its arrays from again."""
        if not step.chain:
            return self.set_aside(step, made.path, error)
        self.report(f"warning: {made.path.name} is damaged and written anew from its frames: {error.message}")
        kept = {name: value for name, value in made.attributes.items() if name != "sealed"}
        return Artifact(made.path, {**kept, "complete": False})

    def set_aside(self, step: Step, path: Path, error: Corrupted) -> Artifact | None:
        """Move a damaged result away and return what takes its place: its copy, where the store is shared."""
        kept = self.store.set_aside(path).relative_to(path.parent)
        copy = self.store.find(step.key)
        what = "made anew" if copy is None else "replaced by its copy"
        self.report(f"warning: {path.name} is damaged and {what}: {error.message} (kept as {kept})")
        return copy
