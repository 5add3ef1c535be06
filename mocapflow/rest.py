"""When the loop of a frame counts as at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.data import CLOTH, Change, Pose, Surface
from mocapflow.records import record


@record
class Steady:
    """What counts as rest, how long the loop may go on, and how it is kept from getting worse."""

    surface: float  # m
    angle: float  # rad
    turns: int  # consecutive turns within both tolerances
    max_turns: int
    halvings: int  # of a step that costs more than where it began, at most

    def holds(self, change: Change) -> bool:
        """True where a change is within both tolerances."""
        return max(change.body, change.cloth) <= self.surface and change.angles <= self.angle


class Shown(NamedTuple):
    """A pose with the surface it has."""

    pose: Pose
    surface: Surface


def measure_change(old: Shown, new: Shown) -> Change:
    """Return how far body, cloth and joint angles moved between two poses."""
    way = new.surface.vertices - old.surface.vertices
    squared = np.einsum("va,va->v", way, way)
    worn = new.surface.layer == CLOTH
    body, cloth = squared[~worn], squared[worn]
    angles = np.abs(new.pose.angles - old.pose.angles)
    return Change(
        body=float(np.sqrt(body.max())),
        cloth=float(np.sqrt(cloth.mean())) if len(cloth) else 0.0,
        angles=float(angles.max(initial=0)),
    )
