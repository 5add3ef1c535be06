"""What stages have to hold to."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import get_type_hints

from mocapflow.components import Stage
from mocapflow.testing.component import Conformance


class StageConformance(Conformance):
    """A whole-sequence stage."""

    role = "stage"
    stage: Stage

    def test_its_inputs_and_output_are_typed(self) -> None:
        """Every parameter of `run` and its result have a type that can be read: they are the wiring."""
        hints = get_type_hints(type(self.stage).run)
        parameters = set(type(self.stage).run.__code__.co_varnames[1 : type(self.stage).run.__code__.co_argcount])
        assert parameters <= hints.keys()
        assert is_dataclass(hints["return"]), "the store keeps a dataclass: return one, or Files"
