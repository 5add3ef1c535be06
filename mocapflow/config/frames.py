"""Which frames of a recording to work on, as a file or the command line says it."""

from __future__ import annotations

from typing import Any

from pydantic import NonNegativeInt, PositiveInt, model_validator

from mocapflow.errors import PipelineError
from mocapflow.settings import Settings

FORM = "frames are written A:B or A:B:STEP; either end may be left out"


class Frames(Settings):
    """The part of the recording to work on: `start` up to, without, `stop`; or A:B, as on the command line."""

    start: NonNegativeInt = 0  # the first frame
    stop: NonNegativeInt | None = None  # where it ends, without this frame; null: with the recording
    step: PositiveInt = 1  # takes every so many-th frame

    @model_validator(mode="before")
    @classmethod
    def _as_on_the_command_line(cls, value: Any) -> Any:
        if isinstance(value, dict | Frames):
            return value
        try:
            part = frames_of(str(value), "")
        except PipelineError as error:
            raise ValueError(error.message) from None
        return {end: given for end in ("start", "stop", "step") if (given := getattr(part, end)) is not None}

    @model_validator(mode="after")
    def _holds_some(self) -> Frames:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"{self.start}:{self.stop} holds no frame")
        return self

    @property
    def text(self) -> str:
        """Return them as they are written on the command line; without a step, that of the pipeline stays."""
        step = f":{self.step}" if "step" in self.model_fields_set else ""
        return f"{self.start}:{'' if self.stop is None else self.stop}{step}"


def frames_of(text: str, where: str) -> slice:
    """Return the frames of `A:B` or `A:B:STEP`, as people write them on the command line.

    Raises:
        PipelineError: it is written otherwise.
    """
    parts = text.split(":")
    if len(parts) not in {2, 3} or not all(part.isdecimal() or not part for part in parts):
        raise PipelineError(FORM, where=where)
    return slice(*(int(part) if part else None for part in parts))
