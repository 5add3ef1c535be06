"""Poses that betray a lost limb: between two frames a leg took the other's contour, a foot its own turned over."""

from __future__ import annotations

import numpy as np
from mocapflow_priors.density import Density

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.records import F64, I32, Bool
from mocapflow_recovery.sampling import parts


def leaping(fitted: Pose, predicted: Pose, body: Body, density: Density, least: float) -> list[I32]:
    """Return the parts of a body that are far from where they were predicted and as far from all that was seen of them.

    Either alone is nothing to wonder at: fast legs leave what was predicted, and nobody has seen everything.

    Args:
        fitted: the pose that is asked about.
        predicted: before the images were looked at.
        body: whose parts are tried.
        density: its training poses are what people were seen in; the angles it does not know count as seen.
        least: rad, what counts as far: for the angle that changed most, and for all angles of a part together.
    """
    moved = parts_with(np.abs(fitted.angles - predicted.angles) > least, body)
    if not moved:  # nearly always
        return []
    seen = density.on(body.screw_names)
    return [part for part in moved if _apart(fitted.angles[part], seen[:, part]) > least]


def overbent(pose: Pose, body: Body, least: float) -> list[I32]:
    """Return the parts of the body with a joint that is bent beyond its limits by more than `least` (rad)."""
    return parts_with(_beyond(pose, body, least), body)


def parts_with(screws: Bool, body: Body) -> list[I32]:
    """Return the parts of the body that some of the screws (D,) belong to."""
    if not screws.any():  # of most poses: no need to look for the parts
        return []
    return [part for part in parts(body) if part is not None and screws[part].any()]


def without_overbent(pose: Pose, other: Pose, body: Body) -> Pose:
    """Return a pose whose joints that are bent beyond their limits have the angles of another pose."""
    return Pose(root=pose.root, angles=np.where(_beyond(pose, body, 0.0), other.angles, pose.angles))


def _beyond(pose: Pose, body: Body, least: float) -> Bool:
    low, high = body.limits.T
    beyond: Bool = (pose.angles > high + least) | (pose.angles < low - least)
    return beyond


def _apart(angles: F64, seen: F64) -> float:
    """Return how far (rad) some angles (K,) are from the nearest ones seen (N, K); 0 where none were seen."""
    known = seen[~np.isnan(seen).all(axis=1)]
    return float(np.sqrt(np.nansum((known - angles) ** 2, axis=1).min())) if len(known) else 0.0
