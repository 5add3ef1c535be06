"""When the loop of a frame counts as at rest."""

from __future__ import annotations

import numpy as np
from pydantic import NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.data import Change, FrameState, Pose
from mocapflow.model import increment_between
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.settings import PositiveOrInf, Settings


class Steady(Settings):
    """When the loop counts as at rest, how long it may go on, and how it is kept from getting worse.

    A turn beyond the last of `sigmas` is compared with that one; a frame that begins far off with none of them.
    """

    surface_mm: PositiveFloat = 0.5  # largest move of a body vertex from turn to turn, RMS move of the cloth
    angle_deg: PositiveFloat = 0.1  # largest change of a joint angle
    sigmas: tuple[NonNegativeFloat, ...] = ()  # of the pose, turn by turn: moves below are rest too
    energy_share: PositiveOrInf = float("inf")  # largest change of the functional from turn to turn
    turns: PositiveInt = 2  # in a row within the tolerances, then the frame is at rest
    max_turns: PositiveInt = 8  # then the frame is left as it is
    far_turns: NonNegativeInt = 0  # the same, if more, of a frame that begins far off, as first ones may
    far_mm: PositiveOrInf = float("inf")  # move of the body in a first turn beyond which the frame began far off
    halvings: NonNegativeInt = 0  # at most, of a step that raises the functional; 0: it is taken whole

    @property
    def cap(self) -> int:
        """How many turns any frame takes at most."""
        return max(self.max_turns, self.far_turns)

    @property
    def beginning(self) -> Steady:
        """What holds for a frame that begins far off: it may take long, and how sure it is says little."""
        return self.model_copy(update={"sigmas": (), "max_turns": self.cap})

    def far(self, change: Change) -> bool:
        """True where a change in the first turn tells that a frame began far from the person."""
        return change.body > self.far_mm / 1000

    def holds(self, change: Change, turns: int) -> bool:
        """True where a change is within both tolerances, or less than the pose is known to."""
        near = max(change.body, change.cloth) <= self.surface_mm / 1000
        exact = near and change.angles <= float(np.radians(self.angle_deg))
        allowed = self.sigmas[min(turns, len(self.sigmas)) - 1] if self.sigmas else 0.0
        return exact or change.sigmas < allowed

    def even(self, before: float, now: float) -> bool:
        """True where the functional has changed by no more than its tolerance; NaN before the first turn."""
        return self.energy_share == float("inf") or abs(now - before) <= self.energy_share * abs(before)


def measure_change(old: FrameState, new: FrameState, scene: Scene) -> Change:
    """Return how far body, cloth and joint angles moved between two states.

    The covariance of the new one weighs the move in `sigmas`: along a direction that no image shows even a long way
    counts little, along one that all images show even a short way counts.
    """
    before, now = map(scene.surface_of, (old, new))
    shift = now.vertices - before.vertices
    squared = np.einsum("va,va->v", shift, shift)
    worn = now.cloth
    body, cloth = squared[~worn], squared[worn]
    angles = np.abs(new.estimate.pose.angles - old.estimate.pose.angles)
    return Change(
        body=float(np.sqrt(body.max())),
        cloth=float(np.sqrt(cloth.mean())) if len(cloth) else 0.0,
        angles=float(angles.max(initial=0)),
        sigmas=_sigmas(old.estimate.pose, new.estimate.pose, new.estimate.covariance),
        shift=shift,
    )


def _sigmas(old: Pose, new: Pose, covariance: F64) -> float:
    """Return the way between two poses in standard deviations, the root mean square over independent directions."""
    way = increment_between(old, new)
    unit = np.sqrt(np.diag(covariance))[: len(way)]  # scaled first: units differ widely
    scaled = covariance[: len(way), : len(way)] / unit[:, None] / unit
    return float(np.sqrt(way / unit @ np.linalg.solve(scaled, way / unit) / len(way)))
