"""Motion goes on as it was: the constant-velocity continuation of the last two frames."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Past, Pose
from mocapflow.geometry import twists
from mocapflow.once import once


def interval(past: Past) -> float:
    """Return the time between the last two frames in s, 0 where there are none."""
    if len(past.moments) < 2:
        return 0.0
    return max(past.moments[-1].time - past.moments[-2].time, 0.0)


@once
def continued(past: Past, steps: float) -> Pose:
    """Return the last pose moved on by `steps` times its last motion: the root by its twist, the angles linearly.

    With one frame, or `steps` of zero, it is the last pose.
    """
    last = past.moments[-1].pose
    if len(past.moments) < 2 or steps == 0:
        return last
    before = past.moments[-2].pose
    twist = twists.log(last.root @ twists.inverse(before.root))
    return Pose(
        root=twists.exp(steps * twist) @ last.root,
        angles=np.asarray(last.angles + steps * (last.angles - before.angles)),
    )
