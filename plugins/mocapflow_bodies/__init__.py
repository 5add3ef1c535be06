"""Bodies: mesh, skeleton and skinning, scanned or scaled from a template."""

from __future__ import annotations

from mocapflow.dressing.roles import BodyModel
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_bodies() -> list[type[BodyModel]]:
    """Return the bodies of this package."""
    from mocapflow_bodies.scanned import Scanned
    from mocapflow_bodies.template import Template

    return [Scanned, Template]
