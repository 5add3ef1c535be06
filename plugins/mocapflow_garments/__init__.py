"""Garments sewn from tape measures."""

from __future__ import annotations

from mocapflow.dressing.roles import Garment
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_garments() -> list[type[Garment]]:
    """Return the garments of this package."""
    from mocapflow_garments.cylinder import Cylinder
    from mocapflow_garments.outfit import Outfit
    from mocapflow_garments.shorts import Shorts
    from mocapflow_garments.skirt import Skirt

    return [Cylinder, Outfit, Shorts, Skirt]
