"""OpenSim's axes: x forward, y up, z right; the world here is z up.

They are permuted cyclically, as Pose2Sim does: OpenSim (x, y, z) = world (y, z, x).
"""

from __future__ import annotations

from mocapflow.records import F64


def opensim_from_world(positions: F64) -> F64:
    """Return positions (..., 3) of a z-up world in OpenSim's y-up axes."""
    return positions[..., [1, 2, 0]]


def world_from_opensim(positions: F64) -> F64:
    """Return positions (..., 3) in OpenSim's y-up axes in the z-up world."""
    return positions[..., [2, 0, 1]]
