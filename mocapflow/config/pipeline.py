"""The pipeline file: what it may say, and the pipeline of components it stands for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PositiveInt

from mocapflow.components import Stage
from mocapflow.config.documents import Document, KeyPath, Place, changed
from mocapflow.config.frames import Frames, frames_of
from mocapflow.config.measures import garment_of, own_places, place_of
from mocapflow.config.named_parts import folder_of
from mocapflow.config.resolve import Resolver
from mocapflow.config.yamlfile import read
from mocapflow.dressing.roles import BodyModel, Garment
from mocapflow.errors import PipelineError, RecordingError
from mocapflow.io.paths import led_nowhere
from mocapflow.registry import Registry, load_registry
from mocapflow.settings import Settings

LABEL = re.compile(r"[\w-]+")  # of a stage


class PartsFile(Settings):
    """A long recording in parts that are tracked each from a start of its own, and joined."""

    count: PositiveInt = 1  # how many; they can be tracked side by side
    overlap: PositiveInt = 30  # frames that neighbours both track
    start: Any = None  # a component `stage`: starts the later parts; null: the one that starts the first
    join: Any = "join"  # a component `stage`


class PipelineFile(Settings):
    """What a pipeline file may say beside `extends: FILE` and `change: {PATH: value, stages.NEW before OLD: stage}`."""

    name: ClassVar[str] = "a pipeline"
    mocapflow: Literal[1] = 1  # version of the format
    recording: str | dict[str, Any] | None = None  # a folder, or {cameras: FILE, videos: DIR, …}
    plugins: tuple[str, ...] = ()  # plugin files, from the folder of this file
    body: Any = "scanned"  # a component `body`
    garment: Any = None  # a component `garment`
    frames: Frames = Frames()
    parts: PartsFile = PartsFile()
    scale: Annotated[float, Field(gt=0, le=1)] = 1.0  # of the images
    stages: dict[str, Any]  # label: component `stage`, in their order


@dataclass(frozen=True)
class NamedStage:
    """A stage with its label; `wiring` names the stages that parameters are taken from."""

    label: str
    stage: Stage
    wiring: Mapping[str, str]
    where: str
    part: range | None = None  # the frames it is for; None: those of the run
    joins: tuple[str, ...] = ()  # the parts that it makes one of
    wiring_places: Mapping[str, str] = field(default_factory=dict)  # parameter -> where its source is written


@dataclass(frozen=True)
class Parts:
    """How a recording is tracked in parts."""

    count: int
    overlap: int  # frames
    start: Stage | None
    join: Stage


@dataclass(frozen=True)
class Pipeline:
    """A pipeline file with every name resolved."""

    name: str
    path: Path
    recording: Path
    body: BodyModel
    garment: Garment | None
    stages: tuple[NamedStage, ...]
    registry: Registry
    garment_where: str = ""  # its measures are written
    garment_places: Mapping[str, str] = field(default_factory=dict)  # setting -> where the pipeline itself says it
    start: int = 0
    stop: int | None = None
    step: int = 1
    scale: float = 1.0  # of the images
    parts: Parts | None = None  # None: in one piece


def load_pipeline(
    path: Path | str,
    registry: Registry | None = None,
    *,
    recording: Path | str | None = None,
    changes: Iterable[str] = (),
    folder: Path | str = Path(),
    frames: slice | None = None,
) -> Pipeline:
    """Read a pipeline file and resolve every name in it.

    Args:
        path: the YAML file.
        registry: where components are looked up; None: the installed plugins and those the file names.
        recording: replaces the recording of the file.
        changes: `PATH=VALUE` as in `--set`.
        folder: where relative paths in changes start.
        frames: replaces first and last frame of the file, and the step where it has one.

    Raises:
        MocapflowError: what is wrong, at which line, and what exists instead.
    """
    document = read(Path(path), changes, Path(folder))
    if frames is not None:
        document = _with_frames(document, frames)
    plain = Resolver(document, Registry())
    if "factors" in document.values:
        hint = "`mocapflow compare` runs one"
        raise PipelineError("this is an experiment, no pipeline", where=plain.place(("factors",)), hint=hint)
    said = plain.build(PipelineFile, document.values, ())
    assert isinstance(said, PipelineFile)
    resolver = Resolver(document, registry or _registry_with(said.plugins, plain))
    recording = _recording(said, recording, Path(path).stem, resolver)
    if all(value is None for value in said.stages.values()):
        raise PipelineError("a pipeline needs stages", where=resolver.place(("stages",)))
    part = said.frames
    return Pipeline(
        name=Path(path).stem,
        path=Path(path),
        recording=recording,
        body=resolver.component("body", said.body, ("body",)),
        garment=garment_of(said.garment, recording, resolver),
        garment_where=place_of(said.garment, recording, resolver),
        garment_places=own_places(said.garment, resolver),
        stages=tuple(_stage(label, value, resolver) for label, value in said.stages.items() if value is not None),
        registry=resolver.registry,
        start=part.start,
        stop=part.stop,
        step=part.step,
        scale=said.scale,
        parts=_parts(said.parts, resolver),
    )


def _registry_with(plugins: tuple[str, ...], resolver: Resolver) -> Registry:
    files = [resolver.file(plugin, ("plugins", index)) for index, plugin in enumerate(plugins)]
    for index, file in enumerate(files):
        if file in files[:index]:
            raise resolver.located(PipelineError("this file is named twice"), ("plugins", index))
    registry = load_registry(files)
    for failure in registry.failures:
        for index, file in enumerate(files):
            if failure.origin.distribution == str(file):
                raise resolver.located(PipelineError(str(failure)), ("plugins", index)) from failure.error
    return registry


def _recording(said: PipelineFile, given: Path | str | None, name: str, resolver: Resolver) -> Path:
    """Return the folder of the recording: the given one, else the one that the file says."""
    folder = Path(given) if given else _written_recording(said, name, resolver)
    if folder.is_dir():
        return folder
    what, where = ("", str(folder)) if given else (f": {folder}", resolver.place(("recording",)))
    option = "--recording DIR names another"
    hint = "\n".join(filter(None, [led_nowhere(folder), option]))
    raise RecordingError(f"there is no such folder{what}", where=where, hint=hint)


def _written_recording(said: PipelineFile, name: str, resolver: Resolver) -> Path:
    if said.recording is None:
        raise resolver.located(PipelineError("no recording: write `recording: DIR`, or give --recording DIR"), ())
    if isinstance(said.recording, dict):
        return folder_of(said.recording, name, resolver)
    return resolver.file(said.recording, ("recording",))


def _with_frames(document: Document, part: slice) -> Document:
    """Return the document with frames as they were written in --frames; a step stays that is not."""
    parts = (part.start, part.stop, part.step)
    written = ":".join("" if value is None else str(value) for value in parts)
    said = {"start": part.start or 0, "stop": part.stop} | ({} if part.step is None else {"step": part.step})
    before, place = document.values.get("frames"), document.place(("frames",))
    if isinstance(before, str) and (step := frames_of(before, place.text).step) is not None:
        before = {"step": step}
    places: dict[KeyPath, Place] = {(): Place(f"--frames {written.removesuffix(':')}", Path())}
    if part.step is None and isinstance(before, dict) and "step" in before:
        said["step"], places["step",] = before["step"], document.place(("frames", "step"))
    return changed(document, "frames", Document(said, places))


def _parts(said: PartsFile, resolver: Resolver) -> Parts | None:
    start = None if said.start is None else resolver.component("stage", said.start, ("parts", "start"))
    if said.count == 1:
        return None
    join = resolver.component("stage", said.join, ("parts", "join"))
    return Parts(count=said.count, overlap=said.overlap, start=start, join=join)


def _stage(label: str, value: Any, resolver: Resolver) -> NamedStage:
    steps = ("stages", label)
    if not LABEL.fullmatch(label):
        hint = "its name is that of files: letters, digits, _ and -"
        raise PipelineError(f"no stage can be called '{label}'", where=resolver.place(steps), hint=hint)
    wiring: Mapping[str, str] = {}
    if isinstance(value, dict) and "from" in value:
        wiring, value = value["from"], {key: inner for key, inner in value.items() if key != "from"}
        if not isinstance(wiring, dict) or not all(isinstance(source, str) for source in wiring.values()):
            message = "write {parameter: label of an earlier stage}"
            raise resolver.located(PipelineError(message), (*steps, "from"))
    stage = resolver.component("stage", value, steps)
    wiring_places = {parameter: resolver.place((*steps, "from", parameter)) for parameter in wiring}
    return NamedStage(label, stage, wiring, resolver.place(steps), wiring_places=wiring_places)
