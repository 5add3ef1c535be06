"""How a run agrees with a reference, and how runs differ: angles, joint centres, cycles, tables, plots."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow_evaluation.evaluate import Evaluate

    return [Evaluate]
