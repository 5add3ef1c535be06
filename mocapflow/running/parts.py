"""A long recording tracked in parts: each from a start of its own, some frames shared with its neighbours, and joined.

The stages of a part have the label of the whole's with their number: `start_2`, `track_2`. Other stages see only what
the parts are joined to, which has the label of the whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from mocapflow.config.pipeline import NamedStage, Parts, Pipeline
from mocapflow.data import Start
from mocapflow.errors import PipelineError
from mocapflow.running.wiring import Source, makes, wire


def in_parts(pipeline: Pipeline, indices: range) -> Pipeline:
    """Return a pipeline whose tracks are made in as many parts as it wants.

    Raises:
        PipelineError: the parts would be shorter than what they share, or another stage has the label of one.
    """
    if pipeline.parts is None:
        return pipeline
    wiring = wire(pipeline)
    parts = [
        part
        for named in pipeline.stages
        for part in _parts(named, wiring[named.label], pipeline.stages, pipeline.parts, indices)
    ]
    stages: dict[str, NamedStage] = {}
    for part in parts:  # two tracks of one start share those of its parts
        if stages.setdefault(part.label, part) != part:
            raise PipelineError(f"no stage can be called '{part.label}': a part has that name", where=part.where)
    return replace(pipeline, stages=tuple(stages.values()))


def split(indices: range, count: int, overlap: int) -> list[range]:
    """Return the frames of each part; all but the first begin `overlap` frames before the one before them ends.

    Raises:
        PipelineError: the parts would be shorter than what they share.
    """
    ends = [round(len(indices) * part / count) for part in range(count + 1)]
    pairs = list(zip(ends, ends[1:], strict=False))
    if min(b - a for a, b in pairs) <= overlap:
        hint = "set a smaller parts.count or parts.overlap"
        raise PipelineError(f"{len(indices)} frames are too few for {count} parts that share {overlap}", hint=hint)
    return [indices[max(a - overlap, 0) : b] for a, b in pairs]


def _parts(
    named: NamedStage, inputs: Mapping[str, Source], stages: Sequence[NamedStage], parts: Parts, indices: range
) -> Iterator[NamedStage]:
    """Yield what a stage becomes: itself, or if it goes on frame by frame, its parts and their join."""
    sources = set(inputs.values())
    if "checkpoint" not in sources:
        yield named
        return
    start = next((other for other in stages if other.label in sources and makes(other, Start)), None)
    ranges = split(indices, parts.count, parts.overlap)
    labels = tuple(f"{named.label}_{number}" for number in range(1, len(ranges) + 1))
    for number, (label, part) in enumerate(zip(labels, ranges, strict=True), 1):
        wiring = named.wiring
        if start is not None and number > 1:
            own = f"{start.label}_{number}"
            wiring = {**wiring, **{name: own for name, source in inputs.items() if source == start.label}}
            yield replace(start, label=own, stage=parts.start or start.stage, part=part)
        yield replace(named, label=label, wiring=wiring, part=part)
    yield NamedStage(named.label, parts.join, {}, named.where, joins=labels)
