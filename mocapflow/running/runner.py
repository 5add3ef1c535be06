"""Runs a pipeline: what is in the store is taken from there, what is half done goes on, the rest is computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from mocapflow.caching.keys import explain
from mocapflow.config.pipeline import Pipeline
from mocapflow.errors import MocapflowError, PipelineError, no_run_folder
from mocapflow.io.paths import for_opencv
from mocapflow.running.execution import Execution, find_hit, is_hit
from mocapflow.running.former_code import as_made
from mocapflow.running.recipes import Step, steps_of
from mocapflow.running.wiring import SUPPLIED, Source
from mocapflow.storage.shared import open_store
from mocapflow.storage.store import Report, Store

# what a recording holds; files of a run in there would be taken for its own
INPUTS = ("videos", "background", "subject", "keypoints", "static", "truth", "reference")


@dataclass(frozen=True)
class PlanLine:
    """What a run would do with one stage, and why."""

    label: str
    action: str  # hit, resume or run
    key: str
    why: str
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

    def __str__(self) -> str:
        spent = ["from the store" if s["cached"] else f"{s['seconds']:.1f} s of CPU" for s in self.stages]
        lines = [f"{s['label']:<11} {text}" for s, text in zip(self.stages, spent, strict=True)]
        return "\n".join([*lines, f"results: {self.out}"])


def plan(pipeline: Pipeline, *, store: Path, url: str | None = None) -> list[PlanLine]:
    """Return for each stage whether its result is there, can be continued, or has to be made, and why."""
    kept = open_store(store, url)
    steps = steps_of(pipeline, kept.digests)
    check_inputs(pipeline, steps, kept)
    lines = [_plan_line(step, kept) for step in steps]
    kept.digests.save()
    return lines


def steps(pipeline: Pipeline, *, store: Path, url: str | None = None) -> list[Step]:
    """Return the stages of a pipeline with their recipes and keys."""
    kept = open_store(store, url)
    found = steps_of(pipeline, kept.digests)
    kept.digests.save()
    return found


def check_apart(out: Path, store: Path, recording: Path) -> None:
    """Check that a run does not write among the files of the recording that it reads.

    Raises:
        PipelineError: the run folder or the store is the recording folder, or lies in one of its folders.
    """
    folder = recording.resolve()
    inside = [(folder / name).resolve() for name in INPUTS]  # links, where a pipeline names each part
    for what, path, option in (("results", out, "--out"), ("stored results", store, "--store")):
        if path.resolve() == folder or any(path.resolve().is_relative_to(place) for place in inside):
            hint = f"give {what} a folder of their own: {option} {Path('runs') / folder.name}"
            raise PipelineError(f"the {what} would lie among the files of the recording", where=str(path), hint=hint)


def check_inputs(pipeline: Pipeline, steps: Sequence[Step], store: Store, fresh: bool = False) -> None:
    """Check that everything is there that has to be read; what comes from the store needs nothing.

    Raises:
        MocapflowError: what is missing, as the stage or body would tell it in the midst of a run.
    """

    def asked(need: Callable[[], None], readers: Sequence[Step]) -> None:
        try:
            need()
        except MocapflowError:
            if any(fresh or find_hit(step, store) is None for step in readers):
                raise

    for step in steps:
        asked(partial(step.named.stage.need, step.recording), [step])
    dressed = [step for step in steps if "scene" in step.sources.values() and step.body is None]
    asked(partial(pipeline.body.need, pipeline.recording), dressed)


def run(
    pipeline: Pipeline,
    *,
    store: Path,
    out: Path,
    url: str | None = None,
    fresh: bool = False,
    only: str | None = None,
    report: Report = lambda line: None,
    begin: Callable[[Sequence[Step]], None] = lambda steps: None,
    made: Mapping[str, str] | None = None,
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
        begin: told the steps, one for each stage, before any is made.
        made: keys by label of what older code has made of the same: that is taken from the store.

    Raises:
        ComponentFailed: a component raised; committed frames are kept.
        StoreError: the store is full or can't be written; committed frames are kept.
        MocapflowError: the pipeline or an input is wrong.
    """
    check_apart(out, store, pipeline.recording)
    for_opencv(out)  # of a path that it can't take people hear now, not when videos are drawn
    kept = open_store(store, url)
    steps = steps_of(pipeline, kept.digests)
    if made is not None:
        steps = as_made(steps, made, kept, report)
    check_inputs(pipeline, steps, kept, fresh)
    kept.create()
    kept.digests.save()
    begin(steps)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise no_run_folder(out, error) from error
    execution = Execution(pipeline, kept, out, steps, fresh=fresh, report=report)
    with threadpool_limits(limits=1, user_api="blas"):  # a frame's matrices are small: threads wait for each other
        for warning in dict.fromkeys(said for step in steps for said in step.recording.warnings):
            report(f"warning: {warning}")
        for step in steps:
            if only is None or step.label == only:
                execution.finish(step)
    return RunSummary(out=out, store=store, stages=tuple(execution.entries.values()))


def _plan_line(step: Step, store: Store) -> PlanLine:
    action, why = _outlook(step, store)
    return PlanLine(step.label, action, step.key, why, step.sources)


def _outlook(step: Step, store: Store) -> tuple[str, str]:
    if step.passes_frames:
        return "run", "changes frames as they are read"
    if not step.stored:
        return "run", "writes files or compares: always"
    found = store.find(step.key)
    if found is not None and is_hit(step, found):
        return "hit", f"{step.frames} frames" if step.chain else ""
    if found is not None and found.frames:
        return "resume", f"{min(found.frames, step.frames)} of {step.frames} frames done"
    near = store.nearest(step.label, step.recipe, but=step.key)
    return "run", f"new: {explain(near.recipe, step.recipe)}" if near else "new"
