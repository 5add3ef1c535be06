"""Search by sampling, part by part of the body: the root, the trunk, and each limb from the trunk outward.

A limb has six to ten angles and its cost hardly depends on the others, so a few dozen samples of one limb do what
all at once would need millions for (annealed and partitioned sampling; Deutscher and Reid 2005, Gall et al. 2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry.kinematics import descendants, root_position
from mocapflow.model import moved
from mocapflow.records import F64, I32, Bool

Cost = Callable[[Sequence[Pose]], F64]  # of poses (B,): (B,), the less the better

SHARES = (1.0, 0.6, 0.4, 0.25, 0.12)  # of the spread of the first samples, round by round


class Spread(NamedTuple):
    """Standard deviations of the first samples; those of later ones are a share of it."""

    angle: float  # rad, of a joint that nothing holds; of others at most that of their rest
    turn: float  # rad, the root
    shift: float  # m, the root


class Plan(NamedTuple):
    """How to sample."""

    spread: Spread
    shares: Sequence[float]  # of the spread, round by round
    samples: int  # of each part in a round
    seen: F64  # (N, D) rad, poses that people were seen in, NaN where an angle is not known; N may be 0
    seen_samples: int  # of each limb among those, in the first round
    only: Sequence[I32] = ()  # parts that are tried; none: all


def search(cost: Cost, pose: Pose, body: Body, plan: Plan, rng: np.random.Generator) -> Pose:
    """Return the best pose found around a pose, or among those that people were seen in; never a worse one.

    In each round every part is tried from the same pose, then the parts move, the one that gains most first, as far
    as that still helps: two legs may want the same place, and the wrong one must not come first.

    Args:
        cost: what is made small.
        pose: where the search begins.
        body: whose parts are tried.
        plan: how to sample.
        rng: of the samples.
    """
    best, least = pose, float(cost([pose])[0])
    for turn, share in enumerate(plan.shares):
        moves = []
        for part in plan.only or parts(body):
            tries = list(samples(best, part, body, plan.spread, share, plan.samples, rng))
            if turn == 0 and part is not None:
                tries += seen_samples(best, part, body, plan, rng)
            costs = cost(tries)
            moves.append((float(costs.min()), part, tries[int(costs.argmin())]))
        for _, part, other in sorted(moves, key=lambda move: move[0]):
            there = with_part(best, part, other)
            value = float(cost([there])[0])
            if value < least:
                best, least = there, value
    return best


def without_idle_parts(cost: Cost, found: Pose, fitted: Pose, body: Body, share: float) -> Pose:
    """Return a found pose in which the parts that mend next to nothing of a mismatch are as they were fitted.

    A search fits every part, also to what no pose explains, such as cloth that flies.

    Args:
        cost: of the mismatch of person and model, which the search brought down.
        found: the pose that a search ended in.
        fitted: the pose in doubt.
        body: whose parts are tried.
        share: of what the search mended: a part that mends less stays as it was fitted.
    """
    before, after = cost([fitted, found])
    for part in parts(body):
        back = with_part(found, part, fitted)
        if float(cost([back])[0]) - after <= share * (before - after):
            found = back
    return found


def put_back(cost: Cost, found: Pose, poses: Sequence[Pose], body: Body, tolerance: float) -> Pose:
    """Return a found pose with parts of other poses put back that fit about as well: what is hidden stays as it was.

    After the parts each joint is tried alone: a foot must not turn because its leg was found.

    Args:
        cost: what is made small.
        found: the pose with the least cost.
        poses: whose parts are preferred, of each the one that fits best.
        body: whose parts are tried.
        tolerance: share of the cost that all together may add.
    """
    least = float(cost([found])[0])
    for part in [*parts(body), *joints(body)]:
        backs = [with_part(found, part, pose) for pose in poses]
        costs = cost(backs)
        if costs.min() <= (1 + tolerance) * least:
            found = backs[int(costs.argmin())]
    return found


def joints(body: Body) -> list[I32]:
    """Return the screws of each joint that has any."""
    return [np.flatnonzero(body.screw_joint == joint).astype(np.int32) for joint in np.unique(body.screw_joint)]


def with_part(pose: Pose, part: I32 | None, other: Pose) -> Pose:
    """Return a pose with one part of another."""
    if part is None:
        return Pose(root=other.root, angles=pose.angles)
    angles = pose.angles.copy()
    angles[part] = other.angles[part]
    return Pose(root=pose.root, angles=angles)


def parts(body: Body) -> list[I32 | None]:
    """Return the screws of each part, the root (None) and the trunk before the limbs.

    A limb is a chain of joints without a fork; what carries several of them is the trunk.
    """
    forks = np.bincount(body.parents[body.parents >= 0], minlength=len(body.parents)) > 1
    below = descendants(body.parents)
    simple: Bool = ~np.any(below & forks, axis=1)  # no fork at or below the joint
    starts = [
        joint for joint, parent in enumerate(body.parents) if simple[joint] and (parent < 0 or not simple[parent])
    ]
    limbs = [np.flatnonzero(below[joint][body.screw_joint]).astype(np.int32) for joint in starts]
    trunk = np.setdiff1d(np.arange(len(body.twists), dtype=np.int32), np.concatenate(limbs))
    return [None, *(part for part in (trunk, *limbs) if len(part))]


def samples(
    pose: Pose, part: I32 | None, body: Body, spread: Spread, share: float, count: int, rng: np.random.Generator
) -> Iterator[Pose]:
    """Yield poses around a pose that differ from it in one part, within the limits of the joints.

    By turns the whole part is tried, and what lies from each further joint on: a leg may be right but for its foot.
    """
    if part is None:
        middle = root_position(body, pose.root)
        turns = share * spread.turn * rng.normal(size=(count, 3))
        shifts = share * spread.shift * rng.normal(size=(count, 3))
        for turn, shift in zip(turns, shifts, strict=True):  # about the root joint
            yield moved(pose, np.concatenate([turn, shift - np.cross(turn, middle), np.zeros(len(pose.angles))]))
        return
    deviation = share * np.minimum(body.rest_spread[part], spread.angle)
    joint = body.screw_joint[part]
    for change, first in zip(rng.normal(size=(count, len(part))), cycle(np.unique(joint))):
        bent = pose.angles.copy()
        bent[part] = np.clip(bent[part] + deviation * change * (joint >= first), *body.limits[part].T)
        yield Pose(root=pose.root, angles=bent)


def seen_samples(pose: Pose, part: I32, body: Body, plan: Plan, rng: np.random.Generator) -> list[Pose]:
    """Return poses with one part as people were seen to hold it; what is not known of it stays."""
    seen = plan.seen[:, part]
    rows = np.flatnonzero(~np.isnan(seen).all(axis=1))
    found = []
    for row in rng.choice(rows, min(plan.seen_samples, len(rows)), replace=False):
        bent = pose.angles.copy()
        bent[part] = np.clip(np.where(np.isnan(seen[row]), bent[part], seen[row]), *body.limits[part].T)
        found.append(Pose(root=pose.root, angles=bent))
    return found
