"""An experiment: one pipeline in variants, on several recordings, read from a YAML file."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from mocapflow.config.frames import Frames
from mocapflow.config.levels import changes_at, levels_at, variant_of
from mocapflow.config.resolve import Resolver
from mocapflow.config.yamlfile import read
from mocapflow.errors import PipelineError
from mocapflow.registry import Registry
from mocapflow.settings import Settings

PIPELINE = "pipeline"  # in a level: another pipeline file instead of a change

Changes = dict[str, Any]  # PATH: value, as in --set
Factors = dict[str, Annotated[dict[str, Changes | None], Field(min_length=1)]]


class ExperimentFile(Settings):
    """What an experiment file may say."""

    name: ClassVar[str] = "an experiment"
    mocapflow: Literal[1] = 1  # version of the format
    pipeline: str  # a pipeline file
    recordings: Annotated[tuple[str, ...], Field(min_length=1)]  # folders
    frames: Frames | None = None  # instead of those of the pipeline; said likewise
    change: Changes = {}  # in every variant
    factors: Factors  # factor: level: what it changes; `pipeline` in a level names another pipeline file


@dataclass(frozen=True)
class Cell:
    """One run of an experiment: a variant on a recording."""

    variant: str  # its level of every factor, e.g. kinematic+contours
    name: str  # of the recording, different from all others
    pipeline: Path
    recording: Path
    changes: tuple[str, ...]  # as in --set
    places: tuple[str, ...]  # where the experiment says each of them
    folder: Path  # of the experiment: paths in changes start there
    frames: str | None


def load_experiment(path: Path, recordings: Sequence[Path] = (), frames: str | None = None) -> tuple[Cell, ...]:
    """Return the runs of an experiment: every combination of levels on every recording, the first one the baseline.

    Args:
        path: the YAML file; paths in it start at its folder.
        recordings: instead of those of the file.
        frames: instead of those of the file.

    Raises:
        PipelineError: the file says something else than an experiment does, or has factors that change the same; with
            its line.
    """
    document = read(path)
    resolver = Resolver(document, Registry())
    if "stages" in document.values:
        hint = "`mocapflow run` runs one; an experiment names it, as `pipeline: FILE`"
        raise PipelineError("this is a pipeline, no experiment", where=str(path), hint=hint)
    said = resolver.build(ExperimentFile, document.values, ())
    assert isinstance(said, ExperimentFile)
    part = frames or (said.frames.text if said.frames else None)
    folders = tuple(recordings) or tuple(
        resolver.file(name, ("recordings", index)) for index, name in enumerate(said.recordings)
    )
    names = short_names(folders)
    common = changes_at(said.change, ("change",), document)
    factors = [levels_at(said.factors[name], ("factors", name), document) for name in said.factors]
    cells = []
    for combination in itertools.product(*factors):
        variant = variant_of(combination)
        chosen = {target: change for level in combination for target, change in level.changes.items()}
        changes = {target: change for target, change in common.items() if target not in chosen} | chosen  # in order
        other = changes.pop(PIPELINE, None)
        file = resolver.file(str(other.value) if other else said.pipeline, (PIPELINE,))
        written = tuple(f"{target}={json.dumps(change.value)}" for target, change in changes.items())
        places = tuple(change.where for change in changes.values())
        cells += [
            Cell(variant, name, file, recording, written, places, path.parent, part)
            for name, recording in zip(names, folders, strict=True)
        ]
    return tuple(cells)


def short_names(folders: Sequence[Path]) -> list[str]:
    """Return the names of folders, all different; those of the same name get their parent's in front.

    Raises:
        PipelineError: two folders have the same name even so, or are the same.
    """
    paths = [Path(os.path.abspath(folder)) for folder in folders]  # `.` has no name
    last = [path.name for path in paths]
    names = [f"{path.parent.name}-{path.name}" if last.count(path.name) > 1 else path.name for path in paths]
    for name in names:
        if names.count(name) > 1:
            same = [str(folder) for folder, other in zip(folders, names, strict=True) if other == name]
            message = f"{len(same)} recordings would be called '{name}': {', '.join(same)}"
            raise PipelineError(message, hint="name each recording once; rename a folder where two end alike")
    return names
