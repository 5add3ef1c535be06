"""Draping: the garment laid on the posed body, and who chooses its parameters."""

from __future__ import annotations

from mocapflow.components import ClothFitter
from mocapflow.dressing.roles import Draper
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_cloth_fitters() -> list[type[ClothFitter]]:
    """Return the cloth fitters of this package."""
    from mocapflow_draping.fixed import Fixed
    from mocapflow_draping.sampled_forces import SampledForces
    from mocapflow_draping.take_up import TakeUp

    return [Fixed, SampledForces, TakeUp]


@hookimpl
def mocapflow_drapers() -> list[type[Draper]]:
    """Return the drapers of this package."""
    from mocapflow_draping.kinematic import Kinematic

    return [Kinematic]
