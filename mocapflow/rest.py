"""When the loop of a frame counts as at rest."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Change, FrameState
from mocapflow.model import ClothedModel
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


def measure_change(old: FrameState, new: FrameState, model: ClothedModel) -> Change:
    """Return how far body, cloth and joint angles moved between two states."""
    before = model.surface(old.estimate.pose, old.cloth).vertices
    after = model.surface(new.estimate.pose, new.cloth).vertices
    squared = np.sum((after - before) ** 2, axis=1)
    body, cloth = np.split(squared, [len(model.scene.body.vertices)])
    angles = np.abs(new.estimate.pose.angles - old.estimate.pose.angles)
    return Change(
        body=float(np.sqrt(body.max())),
        cloth=float(np.sqrt(cloth.mean())) if len(cloth) else 0.0,
        angles=float(angles.max(initial=0)),
    )
