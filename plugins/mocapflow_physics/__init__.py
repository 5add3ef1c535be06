"""Draping by simulation, on an existing simulator: the extra `physics`."""

from __future__ import annotations

from mocapflow.dressing.roles import Draper
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_drapers() -> list[type[Draper]]:
    """Return the drapers of this package."""
    from mocapflow_physics.xpbd import Xpbd

    return [Xpbd]
