"""Runs a pipeline: what is in the store is taken from there, what is half done goes on, the rest is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from mocapflow.caching.keys import explain
from mocapflow.config.named_parts import FOLDERS, WHOLE
from mocapflow.config.pipeline import Pipeline
from mocapflow.errors import PipelineError, no_run_folder
from mocapflow.io.paths import for_opencv
from mocapflow.records import silent
from mocapflow.running.component_failures import FAILURE_LOG
from mocapflow.running.dressing import body_named, sewn
from mocapflow.running.execution import Execution, find_hit, is_hit
from mocapflow.running.ledger import lacking_trace
from mocapflow.running.recipes import Step, steps_of
from mocapflow.running.wiring import SUPPLIED, Source
from mocapflow.storage.shared import open_store
from mocapflow.storage.store import Report, Store


@dataclass(frozen=True)
class PlanLine:
    """What a run would do with one stage, and why."""

    label: str
    action: str  # hit, resume or run
    why: str
    key: str
    sources: Mapping[str, Source]  # parameter -> the stage it comes from

    def __str__(self) -> str:
        supplied = set(SUPPLIED.values())
        wiring = ", ".join(
            f"{name} ← {' '.join(source) if isinstance(source, tuple) else source or 'nothing'}"
            for name, source in self.sources.items()
            if source not in supplied and source != name
        )
        text = f"{self.label:<11} {self.action:<8}{self.key[:4]}…  {self.why}"
        return f"{text:<63} {f'({wiring})' if wiring else ''}".rstrip()


@dataclass(frozen=True)
class RunSummary:
    """What a run did; per stage: label, key, cached, seconds of CPU, wall_seconds, warnings."""

    out: Path
    store: Path
    stages: tuple[Mapping[str, Any], ...]
    files: tuple[Path, ...]  # that stages have written

    def __str__(self) -> str:
        spent = ["from the store" if s["cached"] else f"{s['seconds']:.1f} s of CPU" for s in self.stages]
        lines = [f"{s['label']:<11} {text}" for s, text in zip(self.stages, spent, strict=True)]
        return "\n".join([*lines, f"results: {self.out}"])


@dataclass(frozen=True)
class Prepared:
    """A pipeline with its stages, their recipes and keys, and the store where results are found and kept."""

    pipeline: Pipeline
    store: Store
    steps: Sequence[Step]

    def plan(self) -> list[PlanLine]:
        """Return for each stage whether its result is there, can be continued, or has to be made, and why.

        Raises:
            MocapflowError: a run can't begin; see `check`.
        """
        self._check_inputs(fresh=False)
        return [PlanLine(step.label, *_outlook(step, self.store), step.key, step.sources) for step in self.steps]

    def check(self, out: Path, fresh: bool = False) -> None:
        """Check that a run can begin: inputs are there, the garment fits, a run folder and a store can be made.

        Raises:
            MocapflowError: it can't.
        """
        for_opencv(out)  # of a path that it can't take people hear now, not when videos are drawn
        self._check_inputs(fresh, out / FAILURE_LOG)
        self.store.create()
        self.store.digests.save()

    def run(self, out: Path, *, fresh: bool = False, only: str | None = None, report: Report = silent) -> RunSummary:
        """Make what is not in the store yet and return what was done; see `run`."""
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise no_run_folder(out, error) from error
        execution = Execution(self.pipeline, self.store, out, self.steps, fresh=fresh, report=report)
        with threadpool_limits(limits=1, user_api="blas"):  # a frame's matrices are small: threads wait for each other
            for warning in dict.fromkeys(said for step in self.steps for said in step.recording.warnings):
                report(f"warning: {warning}")
            for step in self.steps:
                if only is None or step.label == only:
                    execution.finish(step)
        ledger = execution.ledger
        return RunSummary(
            out=out, store=self.store.path, stages=tuple(ledger.entries.values()), files=tuple(ledger.files)
        )

    def _check_inputs(self, fresh: bool, log: Path | None = None) -> None:
        """Check what the stages will read, and sew the garment; what comes from the store needs nothing.

        Raises:
            MocapflowError: what is missing or can't be worn, as a stage, body or garment would tell it in a run.
        """
        due = [step for step in self.steps if fresh or find_hit(step, self.store) is None]
        for step in due:
            step.named.stage.need(step.recording)
        as_named = [set(step.sources.values()) for step in due if step.body is None]
        if any(sources & {"scene", "tailor"} for sources in as_named):
            self.pipeline.body.need(self.pipeline.recording)
            body = body_named(self.pipeline, log)
            if any("scene" in sources for sources in as_named):
                sewn(self.pipeline, body, log)


def prepare(pipeline: Pipeline, *, store: Path | str, url: str | None = None) -> Prepared:
    """Return a pipeline with what it would make, and the store; see `run`. Nothing is written but digests."""
    kept = open_store(Path(store), url)
    prepared = Prepared(pipeline, kept, steps_of(pipeline, kept.digests))
    kept.digests.save()
    return prepared


def plan(pipeline: Pipeline, *, store: Path | str, url: str | None = None) -> list[PlanLine]:
    """Return for each stage whether its result is there, can be continued, or has to be made, and why."""
    return prepare(pipeline, store=store, url=url).plan()


def run(
    pipeline: Pipeline,
    *,
    store: Path | str,
    out: Path | str,
    url: str | None = None,
    fresh: bool = False,
    only: str | None = None,
    report: Report = silent,
) -> RunSummary:
    """Run a pipeline and return what was done.

    Args:
        pipeline: what to run.
        store: the folder of cached results.
        out: the run folder.
        url: where the results in that folder are shared with others.
        fresh: compute everything anew.
        only: the label of one stage: make that and what it needs.
        report: told lines of progress.

    Raises:
        ComponentFailed: a component raised; committed frames are kept.
        StoreError: the store is full or can't be written; committed frames are kept.
        MocapflowError: the pipeline or an input is wrong.
    """
    store, out = Path(store), Path(out)
    check_apart(out, store, pipeline.recording)
    prepared = prepare(pipeline, store=store, url=url)
    prepared.check(out, fresh)
    return prepared.run(out, fresh=fresh, only=only, report=report)


def check_apart(out: Path, store: Path, recording: Path) -> None:
    """Check that a run does not write among the files of the recording that it reads.

    Raises:
        PipelineError: the run folder or the store is the recording folder, or lies in one of its folders.
    """
    folder = recording.resolve()
    parts = [folder / name for name in (*FOLDERS, WHOLE)]
    inside = [place.resolve() for part in parts for place in (part, *part.glob("*"))]  # links, where each is named
    for what, path, option in (("results", out, "--out"), ("stored results", store, "--store")):
        if path.resolve() == folder or any(path.resolve().is_relative_to(place) for place in inside):
            hint = f"give {what} a folder of their own: {option} {Path('runs') / folder.name}"
            raise PipelineError(f"the {what} would lie among the files of the recording", where=str(path), hint=hint)


def _outlook(step: Step, store: Store) -> tuple[str, str]:
    """Return what a run would do with a stage, and why."""
    if step.passes_frames:
        return "run", "changes frames as they are read"
    if not step.stored:
        return "run", "writes files or compares: always"
    found = store.find(step.key)
    lack = "" if found is None else lacking_trace(step, found)
    without = f"; {lack} without a trace: --fresh" if lack else ""
    if found is not None and is_hit(step, found):
        return "hit", f"{step.frames} frames{without}" if step.chain else ""
    if found is not None and found.frames:
        return "resume", f"{min(found.frames, step.frames)} of {step.frames} frames done{without}"
    near = store.nearest(step.label, step.recipe, but=step.key)
    return "run", f"new: {explain(near.recipe, step.recipe)}" if near else "new"
