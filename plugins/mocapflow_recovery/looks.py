"""Ways to look for a pose that is lost: near the one that was given, anywhere, in some limbs alone, turned round."""

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
from mocapflow_recovery.disagreement import HANGS
from mocapflow_recovery.judge import Judge
from mocapflow_recovery.leaps import eased
from mocapflow_recovery.sampling import Cost, Plan, put_back, search, seen_samples, with_part, without_idle_parts


class Looks(NamedTuple):
    """Where a search begins, and what it may leave as it was."""

    judge: Judge
    plan: Plan
    believed: Pose  # before looking
    fitted: Pose
    gain: float  # share that each part mends
    tolerance: float  # by which share a part may be farther that stays as it was

    @property
    def body(self) -> Body:
        """Whose parts are sampled."""
        return self.judge.model.scene.body

    def near(self, rng: np.random.Generator, spread: float) -> Pose:
        """Return the pose that agrees best with the views near the one that was given, within a spread (rad)."""
        plan = self.plan._replace(spread=self.plan.spread._replace(angle=spread), seen_samples=0)
        begin = Pose(root=self.fitted.root, angles=self.believed.angles)
        return self._tidied(search(self.judge.apart, begin, self.body, plan, rng), self.judge.apart)

    def far(self, rng: np.random.Generator, astray: bool, cloth: float) -> Pose:
        """Return the pose that agrees best with the views, sampled around those at hand and as people were seen.

        Args:
            rng: of the samples.
            astray: what strays is to be brought together; else all that is apart.
            cloth: what a pixel of cloth counts.
        """
        judge = self.judge._replace(given=None, cloth=cloth)  # it may have been far off
        at_rest, every = np.zeros(len(self.body.twists)), np.arange(len(self.body.twists), dtype=np.int32)
        resting = Pose(root=self.believed.root, angles=at_rest)
        seen_poses = seen_samples(resting, every, self.body, self.plan, rng)
        possible = eased(self.fitted, self.believed, self.body)
        begins = [nearest(judge.apart, [possible, self.believed, *self._before, *seen_poses]), *self._before]
        ends = [search(judge.apart, begin, self.body, self.plan, rng) for begin in dict.fromkeys(begins)]
        # by what strays a fit that is not astray has only idle parts
        looks = self._replace(judge=judge)
        return looks._tidied(nearest(judge.apart, ends), judge.stray if astray else judge.apart)

    def alone(self, rng: np.random.Generator, limbs: Sequence[I32]) -> Pose:
        """Return the pose that agrees best with the views, sampled in some limbs while the others stay.

        They are sampled around where they are fitted, believed, and were in the frame before.
        """
        fitted, plan = eased(self.fitted, self.believed, self.body), self.plan._replace(only=limbs)
        others = [self.believed, *self._before]
        begins = [fitted, *(reduce(lambda pose, limb: with_part(pose, limb, other), limbs, fitted) for other in others)]
        ends = [search(self.judge.apart, begin, self.body, plan, rng) for begin in begins]
        return self._tidied(nearest(self.judge.apart, ends), self.judge.apart)

    def turned(self, rng: np.random.Generator) -> Pose:
        """Return the best pose of somebody who looks the other way."""
        other = turned_round(self.believed, self.body)
        return self._replace(believed=other, fitted=other).far(rng, astray=True, cloth=HANGS)

    @property
    def _before(self) -> list[Pose]:
        """The pose of the frame before, if there is one."""
        return [moment.pose for moment in self.judge.past.moments[-1:]]

    def _tidied(self, found: Pose, measure: Cost) -> Pose:
        """Return a found pose in which the parts that need not have moved are as they were."""
        found = without_idle_parts(measure, found, self.fitted, self.body, self.gain)
        return put_back(self.judge.apart, found, [self.fitted, self.believed], self.body, self.tolerance)


def turned_round(pose: Pose, body: Body) -> Pose:
    """Return a pose turned by half a turn about the vertical through the root joint."""
    turn, middle = np.array([0.0, 0.0, np.pi]), root_position(body, pose.root)
    return moved(pose, np.concatenate([turn, -np.cross(turn, middle), np.zeros(len(pose.angles))]))


def nearest(cost: Cost, poses: Sequence[Pose]) -> Pose:
    """Return the pose of least cost."""
    return poses[int(cost(poses).argmin())]
