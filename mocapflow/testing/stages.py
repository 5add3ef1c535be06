"""What stages have to hold to."""

from __future__ import annotations

import inspect
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
        run = type(self.stage).run
        hints = get_type_hints(run)
        untyped = [name for name in inspect.signature(run).parameters if name != "self" and name not in hints]
        assert not untyped, f"run needs a type for {', '.join(untyped)}"
        assert is_dataclass(hints["return"]), "the store keeps a dataclass: return one, or Files"
