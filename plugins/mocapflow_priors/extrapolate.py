"""Motion goes on as it was: the constant-velocity continuation of the last two frames."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Past, Pose, unseen
from mocapflow.geometry import twists
from mocapflow.once import once
from mocapflow.records import Bool

FASTEST = np.radians(1200)  # per s, of a joint angle; in motion capture of kicks a knee reaches 1130
LASTS = 0.05  # s, of a velocity that no image shows; in motion capture of walks and kicks longer guesses less well


def interval(past: Past) -> float:
    """Return the time between the last two frames in s, 0 where there are none."""
    if len(past.moments) < 2:
        return 0.0
    return max(past.moments[-1].time - past.moments[-2].time, 0.0)


@once
def continued(past: Past, steps: float) -> Pose:
    """Return the last pose moved on by `steps` times its last motion: the root by its twist, the angles linearly.

    With one frame, or `steps` of zero, it is the last pose. An angle that moved faster than people do has jumped, as a
    limb does that was lost or is found again; it does not go on. Nor does one that is seen again: it was where priors
    had it, not the images; nor the whole body, after a frame that did not show it. While nothing shows it, its motion
    dies away.
    """
    last = past.moments[-1].pose
    if len(past.moments) < 2 or steps == 0:
        return last
    before = past.moments[-2].pose
    blind_before, blind = (moment.blind for moment in past.moments[-2:])
    if blind_before and not blind:
        return last
    if blind:
        steps *= float(np.exp(-interval(past) / LASTS))
    turned = last.angles - before.angles
    motion = np.where((np.abs(turned) < FASTEST * interval(past)) & ~_back_in_sight(past), turned, 0.0)
    twist = twists.log(last.root @ twists.inverse(before.root))
    return Pose(
        root=twists.exp(steps * twist) @ last.root,
        angles=np.asarray(last.angles + steps * motion),
    )


def _back_in_sight(past: Past) -> Bool:
    """Return the angles (D,) that the images show in the last frame and did not in the one before."""
    before, last = (moment.observed for moment in past.moments[-2:])
    if before is None or last is None:
        return np.zeros(len(past.moments[-1].pose.angles), bool)
    return np.asarray(unseen(before) & ~unseen(last))
