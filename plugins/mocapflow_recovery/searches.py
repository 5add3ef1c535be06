"""Ways to search for a pose that is lost: near the start, widely, in some limbs alone, turned round."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry.kinematics import root_position
from mocapflow.model import moved
from mocapflow.records import I32
from mocapflow_recovery.disagreement import HANGING
from mocapflow_recovery.leaps import without_overbent
from mocapflow_recovery.sampling import Cost, Plan, put_back, search, seen_samples, with_part, without_idle_parts
from mocapflow_recovery.scoring import Scorer

TOLERANCE = 0.03  # share by which the error may grow for parts to stay as they were


class Searches(NamedTuple):
    """Where a search begins, and what it may leave as it was."""

    scorer: Scorer
    plan: Plan
    predicted: Pose
    fitted: Pose
    gain: float  # share that each part mends

    @property
    def body(self) -> Body:
        """Whose parts are sampled."""
        return self.scorer.model.scene.body

    def local(self, rng: np.random.Generator, spread: float) -> Pose:
        """Return the pose that agrees best with the views near the start, within a spread (rad)."""
        plan = self.plan._replace(spread=self.plan.spread._replace(angle=spread), seen_samples=0)
        begin = Pose(root=self.fitted.root, angles=self.predicted.angles)
        return self._restored(search(self.scorer.distances, begin, self.body, plan, rng), self.scorer.distances)

    def wide(self, rng: np.random.Generator, by_area: bool, cloth_weight: float) -> Pose:
        """Return the pose that agrees best with the views, sampled around those at hand and as people were seen.

        Args:
            rng: of the samples.
            by_area: a part moves only if that lessens the area of mismatch; else the distance.
            cloth_weight: of a pixel of cloth.
        """
        scorer = self.scorer._replace(start=None, cloth_weight=cloth_weight)  # it may have been far off
        at_rest, every = np.zeros(len(self.body.twists)), np.arange(len(self.body.twists), dtype=np.int32)
        resting = Pose(root=self.predicted.root, angles=at_rest)
        seen_poses = seen_samples(resting, every, self.body, self.plan, rng)
        possible = without_overbent(self.fitted, self.predicted, self.body)
        begins = [nearest(scorer.distances, [possible, self.predicted, *self._before, *seen_poses]), *self._before]
        ends = [search(scorer.distances, begin, self.body, self.plan, rng) for begin in dict.fromkeys(begins)]
        # by the area of a fit that has no mismatch, all parts are idle
        searches = self._replace(scorer=scorer)
        return searches._restored(nearest(scorer.distances, ends), scorer.mismatches if by_area else scorer.distances)

    def limbs_alone(self, rng: np.random.Generator, limbs: Sequence[I32]) -> Pose:
        """Return the pose that agrees best with the views, sampled in some limbs while the others stay.

        They are sampled around where they are fitted, predicted, and were in the frame before.
        """
        fitted, plan = without_overbent(self.fitted, self.predicted, self.body), self.plan._replace(only=limbs)
        others = [self.predicted, *self._before]
        begins = [fitted, *(reduce(lambda pose, limb: with_part(pose, limb, other), limbs, fitted) for other in others)]
        ends = [search(self.scorer.distances, begin, self.body, plan, rng) for begin in begins]
        return self._restored(nearest(self.scorer.distances, ends), self.scorer.distances)

    def turned_round(self, rng: np.random.Generator) -> Pose:
        """Return the best pose of somebody who looks the other way."""
        other = half_turn(self.predicted, self.body)
        return self._replace(predicted=other, fitted=other).wide(rng, by_area=True, cloth_weight=HANGING)

    @property
    def _before(self) -> list[Pose]:
        """The pose of the frame before, if there is one."""
        return [moment.pose for moment in self.scorer.past.moments[-1:]]

    def _restored(self, found: Pose, measure: Cost) -> Pose:
        """Return a found pose in which the parts that need not have moved are as they were."""
        found = without_idle_parts(measure, found, self.fitted, self.body, self.gain)
        return put_back(self.scorer.distances, found, [self.fitted, self.predicted], self.body, TOLERANCE)


def half_turn(pose: Pose, body: Body) -> Pose:
    """Return a pose turned by half a turn about the vertical through the root joint."""
    turn, middle = np.array([0.0, 0.0, np.pi]), root_position(body, pose.root)
    return moved(pose, np.concatenate([turn, -np.cross(turn, middle), np.zeros(len(pose.angles))]))


def nearest(cost: Cost, poses: Sequence[Pose]) -> Pose:
    """Return the pose of least cost."""
    return poses[int(cost(poses).argmin())]
