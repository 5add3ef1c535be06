"""The files of a run: angles with their uncertainty, motion and joints for OpenSim, run.json."""

from __future__ import annotations

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages of this package."""
    from mocapflow_export.export import Export, WriteFormats

    return [Export, WriteFormats]
