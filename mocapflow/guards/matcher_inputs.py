"""Whether a recording has what matchers need: an error where none of them has, else warnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mocapflow.components import Matcher
from mocapflow.errors import MocapflowError

if TYPE_CHECKING:
    from mocapflow.recordings.recording import Recording


def check_matcher_inputs(matchers: Sequence[Matcher], recording: Recording) -> list[str]:
    """Return what to say of matchers that will never find a pair.

    Raises:
        MocapflowError: none of them will.
    """
    lacks: list[tuple[str, MocapflowError]] = []
    for matcher in matchers:
        try:
            matcher.need(recording)
        except MocapflowError as error:
            lacks.append((matcher.name, error))
    if lacks and len(lacks) == len(matchers):
        raise lacks[0][1]
    return [f"matcher {name} has nothing to match: {error.message}" for name, error in lacks]
