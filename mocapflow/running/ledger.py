"""What the stages of a run have done and warned of, told as it happens and kept for `run.json`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mocapflow.config.named_parts import whereabouts
from mocapflow.config.pipeline import Pipeline
from mocapflow.results import Files
from mocapflow.running.recipes import Step
from mocapflow.storage.artifacts import Artifact, made_otherwise, versions
from mocapflow.storage.store import Report
from mocapflow.storage.traces import untraced


class Made(NamedTuple):
    """What a stage has made, and what that took."""

    value: Any
    warnings: Sequence[str]
    cpu_s: float
    wall_s: float


class Ledger:
    """The entries of finished stages."""

    def __init__(self, pipeline: Pipeline, steps: Sequence[Step], report: Report) -> None:
        self._pipeline, self._steps, self._report = pipeline, steps, report
        self.entries: dict[str, Mapping[str, Any]] = {}  # per label
        self.files: list[Path] = []  # that stages have written

    def enter_found(self, step: Step, found: Artifact) -> None:
        """Enter a stage whose result is in the store, unless it has been entered."""
        if step.label in self.entries:
            return
        self._report(f"{step.label}: from the store")
        mixed = self.warned_of(step, found)
        self.warn(found.warnings)
        self._enter(step, Made(None, [*found.warnings, *mixed], 0.0, 0.0), cached=True)

    def enter_made(self, step: Step, made: Made) -> None:
        """Enter a stage that this run has run."""
        self._enter(step, made, cached=False)
        self.files += made.value.paths if isinstance(made.value, Files) else ()

    def recipe(self) -> dict[str, Any]:
        """Return how the run makes its results, as far as it has got."""
        pipeline = self._pipeline
        return {
            "pipeline": pipeline.name,
            "recording": whereabouts(pipeline.recording),
            "frames": {"start": pipeline.start, "stop": pipeline.stop, "step": pipeline.step},
            "scale": pipeline.scale,
            "versions": versions(),
            "settings": {step.label: step.recipe["component"] for step in self._steps},
            "stages": dict(self.entries),
        }

    def warned_of(self, step: Step, artifact: Artifact) -> list[str]:
        """Report, and return, what of a result was made with other versions, and which frames lack a trace."""
        indices, said = step.recording.indices, list[str]()
        for first, last, how in made_otherwise(artifact):
            own = indices[first:last]
            if own or not step.chain:
                what = f"frames {own[0]}–{own[-1]} of {step.label}" if step.chain else step.label
                said.append(f"{what} were made with {how}")
        if lack := lacking_trace(step, artifact):
            how = "tracked without keep: trace; --fresh tracks all anew"
            said.append(f"{step.label}: frames {lack} have no trace, for they were {how}")
        self.warn(said)
        return said

    def warn(self, warnings: Iterable[str]) -> None:
        """Report warnings."""
        for warning in warnings:
            self._report(f"warning: {warning}")

    def _enter(self, step: Step, made: Made, cached: bool) -> None:
        self.entries[step.label] = {
            "label": step.label, "key": step.key, "cached": cached, "warnings": list(made.warnings),
            "seconds": made.cpu_s, "wall_seconds": made.wall_s,
        }  # fmt: skip
        self._pipeline.registry.observers.stage_done(step.label, step.key, cached)


def lacking_trace(step: Step, artifact: Artifact) -> str:
    """Return which frames of the store have no trace, where a stage is to keep one, for people; empty: none."""
    return untraced(artifact, step.recording.indices) if step.named.stage.keeps_turns else ""
