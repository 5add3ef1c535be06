"""Motion goes on as it was: the continuation of the last frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.data import Frame, Moment, Past, Pose, unseen
from mocapflow.geometry import twists
from mocapflow.memo import memoised
from mocapflow.records import F64, Bool

FASTEST = np.radians(1200)  # per s, of a joint angle; in motion capture of kicks a knee reaches 1130
SHARPEST = np.radians(15000)  # per s²; more is taken for a jump. Walks reach 10000, a kick 25000 at its sharpest
LASTS = 0.05  # s, of a velocity that no image shows; in motion capture of walks and kicks longer guesses less well


class Motion(NamedTuple):
    """From one frame to the next."""

    twist: F64  # (6,) m and rad, of the root
    angles: F64  # (D,) rad
    credible: Bool  # (D,) False where an angle jumped, or nothing showed where it was before


def interval(past: Past) -> float:
    """Return the time between the last two frames in s, 0 where there are none."""
    if len(past.moments) < 2:
        return 0.0
    return max(past.moments[-1].time - past.moments[-2].time, 0.0)


def ahead(frame: Frame, past: Past) -> float:
    """Return how many such times lie between the last frame and this one; 0 where that is not known."""
    step = interval(past)
    return max(frame.time - past.moments[-1].time, 0.0) / step if step else 0.0


@memoised
def continued(past: Past, steps: float, acceleration: float = 0.0) -> Pose:
    """Return the last pose moved on by `steps` times its last motion: the root by its twist, the angles linearly.

    Of the change from the motion before, the share `acceleration` goes on as well, where it is no jump.

    With one frame, or `steps` of zero, it is the last pose. An angle that moved faster than people do has jumped, as a
    limb does that was lost or is found again; it does not go on. Nor does one that is seen again: it was where priors
    had it, not the images; nor the whole body, after a frame that did not show it. While nothing shows it, its motion
    dies away.
    """
    last = past.moments[-1]
    if len(past.moments) < 2 or steps == 0:
        return last.pose
    before = past.moments[-2]
    if before.blind and not last.blind:
        return last.pose
    if last.blind:
        steps *= float(np.exp(-interval(past) / LASTS))
    motion = _motion(before, last)
    twist, angles = steps * motion.twist, steps * np.where(motion.credible, motion.angles, 0.0)
    if acceleration and (change := _change(past, motion)) is not None:
        gain = acceleration * steps * (steps + 1) / 2
        twist, angles = twist + gain * change.twist, angles + gain * np.where(change.credible, change.angles, 0.0)
    return Pose(root=twists.exp(twist) @ last.pose.root, angles=np.asarray(last.pose.angles + angles))


def _motion(before: Moment, last: Moment) -> Motion:
    turned = last.pose.angles - before.pose.angles
    return Motion(
        twist=twists.log(last.pose.root @ twists.inverse(before.pose.root)),
        angles=turned,
        credible=(np.abs(turned) < FASTEST * (last.time - before.time)) & ~_back_in_sight(before, last),
    )


def _change(past: Past, motion: Motion) -> Motion | None:
    """Return by how much each motion exceeds the one before, were all as long as the last; None: that is not known."""
    moments = past.moments
    if len(moments) < 3 or any(moment.blind for moment in moments):
        return None
    took, earlier = moments[-2].time - moments[-3].time, _motion(*moments[-3:-1])
    if took <= 0:
        return None
    ratio = interval(past) / took
    between = 2 * ratio / (1 + ratio)  # an interval, as a share of the time between the middles of the two
    angles = between * (motion.angles - ratio * earlier.angles)
    return Motion(
        twist=between * (motion.twist - ratio * earlier.twist),
        angles=angles,
        credible=motion.credible & earlier.credible & (np.abs(angles) < SHARPEST * interval(past) ** 2),
    )


def _back_in_sight(before: Moment, last: Moment) -> Bool:
    """Return the angles (D,) that the images show in a frame and did not in the one before."""
    if before.observed is None or last.observed is None:
        return np.zeros(len(last.pose.angles), bool)
    return np.asarray(unseen(before.observed) & ~unseen(last.observed))
