"""One run in progress: results are loaded or made when they are asked for."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from mocapflow.config.pipeline import Pipeline
from mocapflow.data import FrameResult
from mocapflow.dressing.tailor import Tailor
from mocapflow.guards.outputs import made_of
from mocapflow.interrupts import check
from mocapflow.recordings.recording import Recording
from mocapflow.records import silent
from mocapflow.results import RunFolder
from mocapflow.running import damage
from mocapflow.running.component_failures import FAILURE_LOG, naming_failures
from mocapflow.running.dressing import body_named, sewn
from mocapflow.running.ledger import Ledger, Made
from mocapflow.running.progress import Progress
from mocapflow.running.recipes import Step
from mocapflow.running.warning_log import warnings_logged
from mocapflow.running.wiring import Itself, Source, made_by
from mocapflow.scene import Scene
from mocapflow.storage.artifacts import Artifact, with_versions
from mocapflow.storage.checkpoint import Checkpoint
from mocapflow.storage.locks import Lock
from mocapflow.storage.rows import Corrupted
from mocapflow.storage.store import Report, Store


def is_hit(step: Step, artifact: Artifact) -> bool:
    """True where an artifact holds all that a stage would make."""
    return artifact.complete and (not step.chain or artifact.frames >= step.frames)


def find_hit(step: Step, store: Store) -> Artifact | None:
    """Return the artifact that holds all that a stage would make, None where it has to be made."""
    found = store.find(step.key) if step.stored else None
    return found if found is not None and is_hit(step, found) else None


class Execution:
    """Finishes the stages of a pipeline, each at most once."""

    def __init__(
        self, pipeline: Pipeline, store: Store, out: Path, steps: Sequence[Step], *, fresh: bool, report: Report
    ) -> None:
        self._pipeline, self._store, self._out = pipeline, store, out
        self._repairs = damage.Repairs(store, report)
        self._steps = {step.label: step for step in steps}
        self._fresh, self._report = fresh, report
        self._log = out / FAILURE_LOG
        self._naming_failures = partial(naming_failures, registry=pipeline.registry, log=self._log)
        self._results: dict[str, Any] = {}
        self._scenes: dict[tuple[str | None, str | None], Scene] = {}
        self.ledger = Ledger(pipeline, steps, report)

    def finish(self, step: Step) -> None:
        """Make sure that the result of a stage exists; a cached one is usually not even read."""
        if step.label in self.ledger.entries:
            return
        found = self._find(step)
        if found and not step.named.stage.looks_back:
            self.ledger.enter_found(step, found)
        else:
            self._result(step.label)

    def _result(self, label: str) -> Any:
        """Return the result of a stage, from the store or by running it."""
        if label not in self._results:
            step = self._steps[label]
            found = self._find(step)
            self._results[label] = self._made(step) if found is None else self._loaded(step, found)
        return self._results[label]

    def _find(self, step: Step) -> Artifact | None:
        """Return what the store holds, if that is all that a stage would make and it may be taken."""
        return None if self._fresh else find_hit(step, self._store)

    def _loaded(self, step: Step, found: Artifact) -> Any:
        """Return a result from the store; one that can't be read is made anew."""
        try:
            return self._read(step, found)
        except Corrupted:  # or somebody is making it anew: who may write it looks again
            return self._made(step)

    def _read(self, step: Step, found: Artifact) -> Any:
        """Return a result from the store.

        Raises:
            Corrupted: it can't be read back.
        """
        result = self._store.load(found, step.frames if step.chain else None)
        self.ledger.enter_found(step, found)
        if step.named.stage.looks_back:
            step.named.stage.look_back(result)
        return result

    def _made(self, step: Step) -> Any:
        """Return a result that this run makes, or that another one has made while this one waited to write it."""
        if not step.stored:
            return self._entered(step, self._run(step))
        with self._store.writer(step.key, f"{step.label}-{step.key[:6]}", self._report) as lock:
            started = self._started(step)
            while started is not None and is_hit(step, started):  # made by another run, or elsewhere, meanwhile
                try:
                    return self._read(step, started)
                except Corrupted as error:
                    started = self._repairs.mended(step, started, error)
            return self._entered(step, self._chain(step, started, lock) if step.chain else self._whole(step))

    def _entered(self, step: Step, made: Made) -> Any:
        self.ledger.enter_made(step, made)
        return made.value

    def _started(self, step: Step) -> Artifact | None:
        """Return what there is to go on from, for who may write it; nothing where all is to be made anew."""
        started = self._repairs.readable(step)
        if started is not None and self._fresh:
            self._store.discard(started)
            return None
        return started

    def _whole(self, step: Step) -> Made:
        """Run a stage that makes its result at once, and store that."""
        made = self._run(step)
        begun = self._store.begin(step.label, step.key, step.recipe)
        with self._naming_failures(step.named.stage):
            self._store.save(begun, made.value, warnings=made.warnings)
        return made

    def _chain(self, step: Step, started: Artifact | None, lock: Lock) -> Made:
        """Run a stage that goes on frame by frame, from where it has started; its checkpoint stores what it makes."""
        if started is None or not started.frames:
            return self._run(step, self._checkpoint(step, self._store.begin(step.label, step.key, step.recipe), lock))
        self._report(f"{step.label}: going on after {started.frames} frames")
        mixed = self.ledger.warned_of(step, started)
        try:
            return self._run(step, self._checkpoint(step, with_versions(started), lock), mixed)
        except Corrupted as error:
            if "sealed" not in started.attributes:  # it is the frames themselves
                return self._chain(step, self._repairs.set_aside(step, started.path, error), lock)
            return self._chain(step, self._repairs.mended(step, self._store.find(step.key) or started, error), lock)

    def _checkpoint(self, step: Step, artifact: Artifact, lock: Lock) -> Checkpoint:
        """Return where a chain keeps its frames; observers, and who reads of progress, are told of each."""
        indices, observers = step.recording.indices, self._pipeline.registry.observers
        longer = range(indices.start, indices.start + indices.step * max(len(indices), artifact.frames), indices.step)
        names = [camera.name for camera in step.recording.cameras]
        progress = Progress(step.label, self._report)

        def frame_done(frame: int, result: FrameResult) -> None:
            end = "at rest" if result.steady else "left"  # as it is: it has had its `max_turns`
            progress.tell(indices.index(frame) + 1, len(indices), f"{end} after {result.iterations} turns")
            observers.frame_done(frame, result)

        return Checkpoint(
            self._store, artifact, longer, names, lock, wanted=len(indices), fresh=self._fresh,
            iteration_done=observers.iteration_done, frame_done=frame_done,
        )  # fmt: skip

    def _run(self, step: Step, checkpoint: Checkpoint | None = None, mixed: Sequence[str] = ()) -> Made:
        """Run a stage; `mixed` has been told of its earlier frames and is kept with the warnings."""
        inputs = {name: self._input(step, source, checkpoint) for name, source in step.sources.items()}
        self._report(f"{step.label}: running {step.named.stage.name}")
        check()
        cpu, wall, stage = time.process_time(), time.perf_counter(), step.named.stage
        with (
            warnings_logged(self._pipeline.registry.packages) as said,
            self._naming_failures(stage, checkpoint=checkpoint),
        ):
            if checkpoint is not None:
                checkpoint.keep_warnings(said)
            value = made_of(stage, stage.run(**inputs), made_by(step.named))
            self._store.digests.check_inputs()
        told = said if checkpoint is None else checkpoint.warnings
        return Made(value, [*told, *mixed], time.process_time() - cpu, time.perf_counter() - wall)

    def _input(self, step: Step, source: Source, checkpoint: Checkpoint | None) -> Any:
        """Return what a stage is given for one parameter of its `run`, by where that comes from."""
        quiet = checkpoint is not None or step.passes_frames
        watch = silent if quiet else Progress(step.label, self._report, brief=True).tell
        given: Any = None
        match source:
            case tuple():
                given = tuple(self._result(label) for label in source)
            case Itself():
                given = self._steps[source].named.stage
            case "scene":
                given = self._scene(step)
            case "tailor":
                given = self._tailor(step)
            case "recording":
                given = step.recording
            case "checkpoint":
                given = checkpoint
            case "run folder":
                given = RunFolder(path=self._out, recipe=self.ledger.recipe(), watch=watch)
            case str():
                given = self._result(source)
        return replace(given, indices=step.recording.indices, watch=watch) if isinstance(given, Recording) else given

    def _scene(self, step: Step) -> Scene:
        """Return the cameras and the body that hold at this place in the pipeline, and the garment sewn to it."""
        place = step.body, step.rig
        if place not in self._scenes:
            tailor = self._tailor(step)
            scene = self._scenes[place] = tailor.dressed(tailor.body)
            self.ledger.warn(scene.warnings)
        return self._scenes[place]

    def _tailor(self, step: Step) -> Tailor:
        """Return the cameras and the body that hold at this place in the pipeline, and how its garment is sewn."""
        body = self._result(step.body) if step.body else body_named(self._pipeline, self._log)
        cameras = self._result(step.rig).cameras if step.rig else step.recording.cameras
        return Tailor(cameras=cameras, body=body, sew=partial(sewn, self._pipeline, log=self._log))
