"""When the loop of a frame counts as at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.data import Change, Pose, Surface
from mocapflow.geometry import twists
from mocapflow.records import F64, record


@record
class Steady:
    """What counts as rest, how long the loop may go on, and how it is kept from getting worse."""

    surface: float  # m
    angle: float  # rad
    sigmas: float  # standard deviations; a change that small is rest, whatever it is in m and rad,
    min_turns: int  # from this turn on
    turns: int  # consecutive turns within both tolerances
    max_turns: int
    halvings: int  # of a step that costs more than where it began, at most

    def holds(self, change: Change, turns: int) -> bool:
        """True where a change is within both tolerances, or after so many turns less than the pose is known to."""
        exact = max(change.body, change.cloth) <= self.surface and change.angles <= self.angle
        return exact or (turns >= self.min_turns and change.sigmas <= self.sigmas)


class Shown(NamedTuple):
    """A pose with the surface it has."""

    pose: Pose
    surface: Surface


def measure_change(old: Shown, new: Shown, covariance: F64) -> Change:
    """Return how far body, cloth and joint angles moved between two poses.

    In standard deviations of the pose, by its covariance (S, S), a direction that no image shows counts little however
    far it moves, and one that all show counts as soon as it moves.
    """
    shift = new.surface.vertices - old.surface.vertices
    squared = np.einsum("va,va->v", shift, shift)
    worn = new.surface.cloth
    body, cloth = squared[~worn], squared[worn]
    angles = np.abs(new.pose.angles - old.pose.angles)
    return Change(
        body=float(np.sqrt(body.max())),
        cloth=float(np.sqrt(cloth.mean())) if len(cloth) else 0.0,
        angles=float(angles.max(initial=0)),
        sigmas=_sigmas(old.pose, new.pose, covariance),
        shift=shift,
    )


def _sigmas(old: Pose, new: Pose, covariance: F64) -> float:
    """Return the way between two poses in standard deviations, the root mean square over independent directions."""
    way = np.concatenate([twists.log(new.root @ np.linalg.inv(old.root)), new.angles - old.angles])
    unit = np.sqrt(np.diag(covariance))[: len(way)]  # scaled first: units differ widely
    scaled = covariance[: len(way), : len(way)] / unit[:, None] / unit
    return float(np.sqrt(way / unit @ np.linalg.solve(scaled, way / unit) / len(way)))
