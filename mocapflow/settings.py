"""What holds for all settings that a file can give: known names, finite numbers, and no truth value for a number."""

from __future__ import annotations

from abc import ABC
from typing import Annotated, Any, ClassVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationInfo, field_validator

PositiveOrInf = Annotated[PositiveFloat, Field(allow_inf_nan=True)]  # where the largest of all has a meaning


class Settings(BaseModel):
    """Settings by name; whoever has some derives from it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse `yes` and `true`, which Python counts as 1."""
        said = value if isinstance(value, list | tuple) else (value,)
        parts = plain_parts(cls.model_fields[str(info.field_name)].annotation)
        takes = any(part in {bool, Any} or isinstance(part, bool) for part in parts)
        numbers = any(part in {int, float} or isinstance(part, int) for part in parts)
        if numbers and not takes and any(isinstance(each, bool) for each in said):
            raise ValueError("input should be a number, not true or false")
        return value


class Component(Settings, ABC):
    """Anything a pipeline can name; `role` is set by the role base, `name` by the component."""

    role: ClassVar[str]
    name: ClassVar[str]


def plain_parts(annotation: Any) -> set[Any]:
    """Return the plain types an annotation is made of."""
    if get_origin(annotation) is None:
        return {annotation}
    return set().union(*(plain_parts(part) for part in get_args(annotation)))
