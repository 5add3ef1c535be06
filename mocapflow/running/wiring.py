"""Connects stages by the types of `run`: each parameter gets the nearest earlier result of its type."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from mocapflow.components import Stage
from mocapflow.config.pipeline import NamedStage, Pipeline
from mocapflow.errors import PipelineError, PluginError, alternatives
from mocapflow.registry import Registry


class Itself(str):
    """The label of an earlier stage that is handed over itself, with its settings, instead of what it made."""


SUPPLIED = {
    "Scene": "scene", "Tailor": "tailor", "Recording": "recording", "Checkpoint": "checkpoint",
    "RunFolder": "run folder",
}  # fmt: skip


Source = str | tuple[str, ...] | None


def wire(pipeline: Pipeline) -> dict[str, dict[str, Source]]:
    """Return, for each stage, where each parameter of its `run` comes from.

    A source is the label of an earlier stage (a tuple of all that make the type, where `run` takes a tuple; `Itself`
    where it takes a stage), `scene`, `tailor`, `recording`, `checkpoint` or `run folder` (supplied by the runner where
    no earlier stage makes one), or None for an optional input that nobody makes.

    Raises:
        PipelineError: no earlier stage makes what a stage needs, or `from` names a wrong one.
    """
    stages = pipeline.stages
    return {named.label: _wire_stage(named, stages[:at], pipeline.registry) for at, named in enumerate(stages)}


def latest(wanted: type, earlier: Sequence[NamedStage]) -> str | None:
    """Return the label of the last stage that makes a type: a Body replaces the scene's, a Rig its cameras."""
    makers = [named.label for named in earlier if makes(named, wanted)]
    return makers[-1] if makers else None


def makes(named: NamedStage, wanted: type | UnionType) -> bool:
    """True where a stage makes a type, or one of several."""
    made = made_by(named)
    return isinstance(made, type) and issubclass(made, wanted)


def made_by(named: NamedStage) -> Any:
    """Return the type that a stage says it makes."""
    return _hints(named)["return"]


def _wire_stage(named: NamedStage, earlier: Sequence[NamedStage], registry: Registry) -> dict[str, Source]:
    if named.label in SUPPLIED.values():
        raise PipelineError(f"no stage can be called '{named.label}': inputs have that name", where=named.where)
    hints = {name: hint for name, hint in _hints(named).items() if name != "return"}
    for parameter in named.wiring:
        if parameter not in hints:
            message = f"stage '{named.label}' has no input '{parameter}'"
            raise PipelineError(message, where=named.wiring_places[parameter], hint=alternatives(parameter, hints))
    return {name: _source(named, name, hint, earlier, registry) for name, hint in hints.items()}


def _source(named: NamedStage, parameter: str, hint: Any, earlier: Sequence[NamedStage], registry: Registry) -> Source:
    shown = [other for other in earlier if other.part in {None, named.part}]  # parts only see their own
    if get_origin(hint) is tuple:
        return named.joins or _several(named, parameter, get_args(hint)[0], shown)
    wanted, optional = _without_none(hint)
    if isinstance(wanted, type) and issubclass(wanted, Stage):
        return _itself(named, parameter, wanted, earlier)
    if parameter in named.wiring:
        return _chosen(named, parameter, wanted, shown)
    supplied = SUPPLIED.get(wanted.__name__) if wanted.__module__.startswith("mocapflow.") else None
    source = latest(wanted, shown) or supplied
    if source is None and not optional:
        article = "an" if wanted.__name__[0] in "AEIOU" else "a"
        message = f"stage '{named.label}' needs {article} {wanted.__name__} but no earlier stage makes one"
        raise PipelineError(message, where=named.where, hint=alternatives("", _makers(wanted, registry)))
    return source


def _itself(named: NamedStage, parameter: str, wanted: type[Stage], earlier: Sequence[NamedStage]) -> Itself:
    """Return the last stage of a class, or the one that `from` names; all parts of a track are set alike."""
    labels = [other.label for other in earlier if isinstance(other.stage, wanted)]
    chosen = [label for label in labels if label == named.wiring.get(parameter, label)]
    if not chosen:
        message = f"stage '{named.label}' needs a stage {wanted.name} before it"
        place = named.wiring_places.get(parameter, named.where)
        raise PipelineError(message, where=place, hint=alternatives(named.wiring.get(parameter, ""), labels))
    return Itself(chosen[-1])


def _several(named: NamedStage, parameter: str, wanted: type, earlier: Sequence[NamedStage]) -> tuple[str, ...]:
    """Return all earlier stages that make a type, or the one that `from` names."""
    if parameter in named.wiring:
        return (_chosen(named, parameter, wanted, earlier),)
    return tuple(other.label for other in earlier if makes(other, wanted))


def _makers(wanted: type, registry: Registry) -> list[str]:
    """Return the names of the installed stages whose `run` says that it returns a type; none of them is asked more."""
    stages: Mapping[str, Sequence[Any]] = registry.provided("stage")
    said = {name: classes[0].run.__annotations__.get("return") for name, classes in stages.items()}
    return [name for name, made in said.items() if getattr(made, "__name__", made) == wanted.__name__]


def _chosen(named: NamedStage, parameter: str, wanted: type, earlier: Sequence[NamedStage]) -> str:
    label = named.wiring[parameter]
    fitting = [other.label for other in earlier if makes(other, wanted)]
    if label not in fitting:
        message = f"stage '{named.label}' wants its {parameter} from '{label}', but no earlier '{label}' makes one"
        place = named.wiring_places.get(parameter, named.where)
        raise PipelineError(message, where=place, hint=alternatives(label, fitting))
    return label


def _without_none(hint: Any) -> tuple[Any, bool]:
    """Return X of a hint X or X | None, and whether None is allowed."""
    if get_origin(hint) not in {Union, UnionType}:
        return hint, False
    kinds = [kind for kind in get_args(hint) if kind is not NoneType]
    return (kinds[0] if len(kinds) == 1 else hint), len(kinds) < len(get_args(hint))


def _hints(named: NamedStage) -> Mapping[str, Any]:
    """Return the types of the parameters of a stage's `run`, and of what it returns."""
    run, who = type(named.stage).run, f"stage '{named.label}': {named.stage.name}"
    try:
        hints = get_type_hints(run)
    except NameError as error:
        hint = "import the types that run names when the module is imported, not under TYPE_CHECKING"
        raise PluginError(f"{who}: its inputs can't be read: {error}", where=named.where, hint=hint) from None
    parameters = [name for name in inspect.signature(run).parameters if name != "self"]
    if missing := [name for name in [*parameters, "return"] if name not in hints]:
        raise PluginError(f"{who}: run needs a type for {', '.join(missing)}", where=named.where)
    if not is_dataclass(hints["return"]):
        hint = "put what it makes into a dataclass of its own; return Files, with their paths, if it writes files"
        said = inspect.formatannotation(hints["return"])
        raise PluginError(f"{who}: run returns {said}, which the store can't keep", where=named.where, hint=hint)
    for name in parameters:
        if not _can_be_wired(hints[name]):
            said = inspect.formatannotation(hints[name])
            hint = "it takes X, `X | None`, or `tuple[X, ...]` for all of that type, where X is the type of a result"
            raise PluginError(f"{who}: run takes {name} as {said}, which no stage makes", where=named.where, hint=hint)
    return {name: hints[name] for name in [*parameters, "return"]}


def _can_be_wired(hint: Any) -> bool:
    """True for X, X | None and tuple[X, ...], where X is a class."""
    wanted = get_args(hint)[0] if get_origin(hint) is tuple else _without_none(hint)[0]
    return isinstance(wanted, type)
