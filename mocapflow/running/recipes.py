"""What every stage of a pipeline would be made from: its recipe, its key, the frames it reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mocapflow.assets import Background, Body, Camera, Rig
from mocapflow.caching.digests import Digests, digest_array
from mocapflow.caching.keys import FORMAT, Recipe, component_recipe, key_of, without_code
from mocapflow.components import Stage
from mocapflow.config.pipeline import NamedStage, Pipeline
from mocapflow.data import Start
from mocapflow.dressing.roles import BodyModel
from mocapflow.errors import PluginError, alternatives
from mocapflow.output_checks import InvalidOutput
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.results import Evaluation, Files
from mocapflow.running.parts import in_parts
from mocapflow.running.wiring import Source, latest, makes, wire

BEGINNING = 10  # frames of the extent "beginning"
EXTENTS = {Start: "first", Background: "all", Rig: "all", Body: "all", Recording: "all"}  # by what a stage makes


@dataclass(frozen=True)
class Step:
    """One stage, ready to be looked up in the store or run."""

    named: NamedStage
    sources: Mapping[str, Source]  # parameter -> label of a stage, or who supplies it
    body: str | None  # the stage whose Body replaces the pipeline's
    rig: str | None  # the stage whose Rig replaces the recording's cameras
    recording: Recording  # as this stage sees it
    recipe: Recipe
    key: str

    @property
    def label(self) -> str:
        """What the pipeline calls it."""
        return self.named.label

    @property
    def content(self) -> str:
        """A key of this stage and its inputs by pipeline and recording alone, whatever the code."""
        read = {"from": self.sources, "body": self.body, "rig": self.rig}
        return key_of({**without_code(self.recipe), "read": read})

    @property
    def chain(self) -> bool:
        """True where it goes on frame by frame."""
        return "checkpoint" in self.sources.values()

    @property
    def frames(self) -> int:
        """How many frames a chain has to have."""
        return len(self.recording.indices)

    @property
    def stored(self) -> bool:
        """False for a stage that writes files or compares: it always runs."""
        return not makes(self.named, Files | Evaluation) and not self.passes_frames

    @property
    def passes_frames(self) -> bool:
        """True for a stage that only says how frames are to be read."""
        return makes(self.named, Recording)


def steps_of(pipeline: Pipeline, digests: Digests) -> list[Step]:
    """Return the stages of a pipeline in order, each with its recipe and key."""
    recording = open_recording(
        pipeline.recording, start=pipeline.start, stop=pipeline.stop, step=pipeline.step, scale=pipeline.scale
    )
    pipeline = in_parts(pipeline, recording.indices)
    wiring, steps, core = wire(pipeline), dict[str, Step](), digests.core()
    for at, named in enumerate(pipeline.stages):
        sources, earlier = wiring[named.label], pipeline.stages[:at]
        body, rig = latest(Body, earlier), latest(Rig, earlier)
        chain = "checkpoint" in sources.values()
        tracked = recording if named.part is None else replace(recording, indices=named.part)
        seen = replace(tracked, indices=_extent(named, tracked))
        recipe: dict[str, Any] = {
            "format": FORMAT,
            "core": core,
            "component": component_recipe(named.stage, pipeline.registry, digests),
            "inputs": {name: _inputs(steps, source, chain) for name, source in sources.items()},
        }
        changed = [label for label, step in steps.items() if step.passes_frames]
        if {"recording", *changed} & set(sources.values()):
            recipe["recording"] = _frames(seen, pipeline, chain) | _content(seen, digests)
        if {"scene", "tailor"} & set(sources.values()):
            recipe["scene"] = _scene(pipeline, recording, steps.get(body or ""), steps.get(rig or ""), digests)
        recipe["files"] = _files(named.stage, recording.folder, digests)
        steps[named.label] = Step(named, sources, body, rig, seen, recipe, key_of(recipe))
    return list(steps.values())


def _extent(named: NamedStage, recording: Recording) -> range:
    """Return the frames that a stage sees, by the extent that it names or that goes with what it makes."""
    usual = [extent for cls, extent in EXTENTS.items() if makes(named, cls)]
    extent = named.stage.extent or (usual[0] if usual else "run")
    run = recording.indices
    onward = range(run.start, recording.length, run.step)
    extents = {"first": run[:1], "beginning": onward[:BEGINNING], "run": run, "all": range(recording.length)}
    if extent not in extents:
        message = f"stage '{named.label}': {named.stage.name} has the extent '{extent}'"
        raise PluginError(message, where=named.where, hint=alternatives(extent, extents))
    return extents[extent]


def _inputs(steps: Mapping[str, Step], source: Source, of_chain: bool) -> Any:
    """Return what stands in a recipe for one parameter of a stage; None where no stage makes it."""
    if isinstance(source, tuple):
        return [_input(steps[label], of_chain) for label in source]
    return _input(steps[source], of_chain) if source is not None and source in steps else None


def _input(step: Step, of_chain: bool = False) -> dict[str, Any]:
    """Return what stands for a stage in the recipe of another one, which may be a chain."""
    if of_chain and step.named.stage.causal:  # more frames only add to it
        read = {name: value for name, value in step.recipe.get("recording", {}).items() if name != "stop"}
        return {"key": key_of({**step.recipe, "recording": read})}
    return {"key": step.key} | ({"frames": step.frames} if step.chain else {})


def _frames(seen: Recording, pipeline: Pipeline, chain: bool) -> dict[str, Any]:
    """Return which frames are read; where a chain stops is no matter, it can go on."""
    indices = seen.indices
    stop = {} if chain else {"stop": indices[-1] + 1}
    return {
        "start": indices.start,
        "step": indices.step if len(indices) > 1 or chain else 1,
        "scale": repr(pipeline.scale),
        **stop,
    }


def _content(seen: Recording, digests: Digests) -> dict[str, Any]:
    """Return what the files hold that frames are read from, and the code that reads them."""
    return {
        "content": {name: digests.file(path, name) for name, path in sorted(seen.content.items())},
        "reader": digests.package("mocapflow.recordings.recording"),
    }


def _scene(
    pipeline: Pipeline, recording: Recording, body: Step | None, rig: Step | None, digests: Digests
) -> dict[str, Any]:
    garment = pipeline.garment
    return {
        "cameras": _input(rig) if rig else {camera.name: _camera(camera) for camera in recording.cameras},
        "body": _input(body) if body else _body(pipeline, digests),
        "garment": None if garment is None else component_recipe(garment, pipeline.registry, digests),
    }


def _body(pipeline: Pipeline, digests: Digests) -> dict[str, Any]:
    files = _files(pipeline.body, pipeline.recording, digests)
    return component_recipe(pipeline.body, pipeline.registry, digests) | {"files": files}


def _files(component: BodyModel | Stage, recording: Path, digests: Digests) -> dict[str, list[str]]:
    """Return the digests of the files that a component reads besides the frames, by their names: these may matter."""
    paths = component.inputs(recording)
    if not isinstance(paths, list | tuple) or not all(isinstance(path, Path) for path in paths):
        raise InvalidOutput(component, f"the inputs {paths!r}, which are no list of Path")
    found: dict[str, list[str]] = {}
    for path in filter(Path.exists, paths):
        name = path.relative_to(recording).as_posix() if path.is_relative_to(recording) else path.name
        found.setdefault(name, []).append(digests.file(path, path.name))
    return found


def _camera(camera: Camera) -> list[str]:
    parts = (camera.size, camera.intrinsics, camera.distortion, camera.camera_from_world)
    return [f"{digest_array(part)} {camera.name}" for part in parts] + [f"fisheye {camera.fisheye}"]
