"""Turns what a pipeline file says into components: names looked up, settings checked, errors with their line."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.errors import PydanticUserError

from mocapflow.config.documents import Document, KeyPath, dotted
from mocapflow.errors import MocapflowError, PipelineError, PluginError, guess, raised
from mocapflow.registry import Registry
from mocapflow.settings import Component, plain_parts

LINES = "input should be `name: value` lines"
EXPECTED = {"dict_type": LINES, "model_type": LINES, "tuple_type": "input should be a list"}  # as YAML has it


class Resolver:
    """Builds the components a document names."""

    def __init__(self, document: Document, registry: Registry) -> None:
        self._document, self.registry = document, registry

    def component(self, role: str, value: Any, steps: KeyPath, defaults: Mapping[str, Any] | None = None) -> Any:
        """Return the component written at `steps` as a name or as {use: name, setting: value}.

        Args:
            role: which kind of component.
            value: what the file says.
            steps: where it says so.
            defaults: settings that hold where the file gives none.

        Raises:
            MocapflowError: no such component or setting, or a wrong value; with its line.
        """
        name, given = self._name_and_settings(role, value, steps)
        try:
            cls = self.registry.get(role, name)
        except MocapflowError as error:
            raise self.located(error, steps) from None
        fields = cls.model_fields
        settings = {key: self._setting(fields[key].annotation, inner, (*steps, key)) if key in fields else inner
                    for key, inner in given.items()}  # fmt: skip
        return self.build(cls, {**(defaults or {}), **settings}, steps)

    def build(self, cls: type[BaseModel], settings: Mapping[str, Any], steps: KeyPath) -> BaseModel:
        """Return an instance of a pydantic model; what its validation raises is told by line."""
        try:
            return cls(**settings)
        except ValidationError as error:
            raise self._wrong_setting(cls, error, steps) from None
        except PydanticUserError as error:
            message = f"{_title(cls)} is not complete: {error.message.splitlines()[0]}"
            hint = "import the types of its settings when the module is imported, not under TYPE_CHECKING"
            raise self.located(PipelineError(message, hint=hint), steps) from None
        except MocapflowError as error:
            raise self.located(error, steps) from None
        except (Exception, SystemExit) as error:  # of a plugin's own validator
            raise self.located(PluginError(f"{_title(cls)} can't be made: {raised(error)}"), steps) from error

    def place(self, steps: KeyPath) -> str:
        """Return where a value is written, as file:line:column."""
        return self._document.place(steps).text

    def located(self, error: MocapflowError, steps: KeyPath) -> MocapflowError:
        """Return an error told with the place and the path of a value."""
        message = f"{dotted(steps)}: {error.message}" if steps else error.message
        return type(error)(message, where=self.place(steps), hint=error.hint)

    def file(self, value: str, steps: KeyPath) -> Path:
        """Return a path written in the file; a relative one starts at the folder of the file."""
        return Path(os.path.normpath(self._document.place(steps).folder / os.path.expanduser(value)))

    def _name_and_settings(self, role: str, value: Any, steps: KeyPath) -> tuple[str, dict[str, Any]]:
        if isinstance(value, str):
            return value, {}
        if isinstance(value, dict) and isinstance(value.get("use"), str):
            return value["use"], {key: inner for key, inner in value.items() if key != "use"}
        hint = f"available: {', '.join(self.registry.names(role)) or 'none'}"
        if isinstance(value, dict) and value and "use" not in value:  # under `change` it would replace the whole
            hint = f"{hint}\nto change a part of it alone, write {dotted((*steps, next(iter(value))))}: ..."
        message = f"name a {role}, as `name` or as {{use: name, setting: value}}"
        raise self.located(PipelineError(message, hint=hint), steps)

    def _setting(self, annotation: Any, value: Any, steps: KeyPath) -> Any:
        """Return a value of the file as the model takes it: nested components built, paths made absolute."""
        base = _component_base(annotation)
        if value is None and (base is None or NoneType in plain_parts(annotation)):
            return None
        if base is None:
            is_path = isinstance(value, str) and Path in plain_parts(annotation)
            return self.file(value, steps).absolute() if is_path else value
        if not _takes_several(annotation):
            return self.component(base.role, value, steps)
        if not isinstance(value, list):
            return (self.component(base.role, value, steps),)
        wanted = [(index, item) for index, item in enumerate(value) if item is not None]  # `null` leaves one out
        return tuple(self.component(base.role, item, (*steps, index)) for index, item in wanted)

    def _wrong_setting(self, cls: type[BaseModel], error: ValidationError, steps: KeyPath) -> MocapflowError:
        errors = error.errors(include_url=False)
        first = errors[0]
        if first["type"] == "missing":  # it may be there, misspelt
            first = next((wrong for wrong in errors if wrong["type"] == "extra_forbidden"), first)
        location = first["loc"]
        if first["type"] == "missing":
            described = ", ".join(dotted(wrong["loc"]) for wrong in error.errors() if wrong["type"] == "missing")
            return self.located(PipelineError(f"{_title(cls)} needs {described}"), steps)
        if first["type"] == "extra_forbidden":
            owner = _model_at(cls, location[:-1])
            known = sorted(owner.model_fields)
            message = f"unknown setting of {_title(owner)} ({', '.join(known) or 'it has none'})"
            return self.located(PipelineError(message, hint=guess(str(location[-1]), known)), (*steps, *location))
        while location and not self._is_setting(cls, location, steps):
            location = location[:-1]  # pydantic also names the members of a union
        if first["type"] == "too_short":
            least = first["ctx"]["min_length"]
            message = f"needs at least {least} entr{'y' if least == 1 else 'ies'}"
            return self.located(PipelineError(message), (*steps, *location))
        reason = EXPECTED.get(first["type"], first["msg"].removeprefix("Value error, "))
        got = "" if isinstance(first["input"], dict | BaseModel) else f", not {first['input']!r}"
        message = reason if first["type"] == "value_error" else reason[:1].lower() + reason[1:] + got
        return self.located(PipelineError(message), (*steps, *location))

    def _is_setting(self, cls: type[BaseModel], location: tuple[str | int, ...], steps: KeyPath) -> bool:
        known = _model_at(cls, location[:-1]).model_fields
        return (*steps, *location) in self._document.places or location[-1] in known


def _title(cls: type[BaseModel]) -> str:
    return str(getattr(cls, "name", cls.__name__.lower()))


def _component_base(annotation: Any) -> type[Component] | None:
    bases = [part for part in plain_parts(annotation) if isinstance(part, type) and issubclass(part, Component)]
    return bases[0] if bases else None


def _takes_several(annotation: Any) -> bool:
    return get_origin(annotation) in {tuple, list, Sequence} or any(map(_takes_several, get_args(annotation)))


def _model_at(cls: type[BaseModel], location: tuple[str | int, ...]) -> type[BaseModel]:
    for step in location:
        inner = cls.model_fields[step].annotation if step in cls.model_fields else None
        models = [part for part in plain_parts(inner) if isinstance(part, type) and issubclass(part, BaseModel)]
        cls = models[0] if models else cls
    return cls
