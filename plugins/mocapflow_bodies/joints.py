"""The table from joint names to degrees of freedom: axes, limits and stiffness of every joint.

Axes are written for the left side in the body's own directions (left, forward, up), read off the skeleton, and
mirrored for the right, so that equal angles are mirror images. Limits of knees and elbows count from the straight
limb, of other joints from the rest pose. The ranges were checked against motion capture and scripted takes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mocapflow.geometry import twists
from mocapflow.geometry.skeleton import Skeleton, unsided
from mocapflow.records import F64, I32
from mocapflow_bodies.axes import joint_axes, rest_bend

FREE = math.inf


class Dof(NamedTuple):
    """One screw of a joint."""

    name: str
    axis: str  # a key of `joint_axes`, with its sign
    low_deg: float
    high_deg: float
    spread_deg: float = FREE  # standard deviation about rest of a stiff degree of freedom


class Screws(NamedTuple):
    """The screws of a skeleton, in the order of its joints."""

    names: tuple[str, ...]
    twists: F64  # (D, 6)
    joint: I32  # (D,)
    limits: F64  # (D, 2) rad
    rest_spread: F64  # (D,) rad


# A turn about -left swings what hangs down forwards, about +forward swings it to the left, about +up turns it left.
TRUNK = (Dof("flexion", "left", -40, 60, 10), Dof("bend", "-forward", -40, 40, 8), Dof("twist", "up", -40, 40, 8))
NECK = (Dof("flexion", "left", -60, 60, 20), Dof("bend", "-forward", -60, 60, 20), Dof("twist", "up", -80, 80, 25))
HEAD = (Dof("flexion", "left", -40, 40, 8), Dof("bend", "-forward", -40, 40, 8), Dof("twist", "up", -40, 40, 8))
BALL = (Dof("flexion", "left", -170, 170), Dof("bend", "-forward", -85, 85), Dof("twist", "up", -170, 170))

TABLE: Mapping[str, tuple[Dof, ...]] = {
    "hip": (
        Dof("flexion", "-left", -50, 145),
        Dof("abduction", "forward", -50, 80),
        Dof("rotation", "-up", -80, 80, 25),
    ),
    "knee": (Dof("flexion", "left", -8, 160), Dof("varus", "-forward", -15, 15, 3), Dof("rotation", "-up", -20, 20, 3)),
    "ankle": (
        Dof("dorsiflexion", "-left", -75, 75, 20),
        Dof("inversion", "-forward", -45, 45, 12),
        Dof("rotation", "-up", -45, 45, 8),
    ),
    "toe": (Dof("dorsiflexion", "-left", -40, 70, 10),),
    "spine": TRUNK,
    "chest": TRUNK,
    "neck": NECK,
    "head": HEAD,
    "shoulder": (
        Dof("raise", "raise", -110, 170),
        Dof("sweep", "sweep", -80, 80),
        Dof("roll", "along", -120, 120, 50),
    ),
    "elbow": (
        Dof("flexion", "hinge", -10, 160),
        Dof("varus", "across", -25, 25, 5),
        Dof("pronation", "along", -90, 90, 15),
    ),
    "wrist": (Dof("flexion", "hinge", -80, 80, 10), Dof("deviation", "across", -45, 45, 8)),
}
FROM_STRAIGHT = ("knee", "elbow")  # joints whose flexion limits count from the straight limb


def screws(skeleton: Skeleton) -> Screws:
    """Return the screws of a skeleton by the table; an unknown joint is a ball, the root has none."""
    names: list[str] = []
    axes, joints, limits, spread = [], [], [], []
    for joint in np.flatnonzero(skeleton.parents >= 0):
        name, available = skeleton.names[joint], joint_axes(skeleton, int(joint))
        for dof in TABLE.get(unsided(name), BALL):
            axis = -available[dof.axis[1:]] if dof.axis.startswith("-") else available[dof.axis]
            from_rest = dof.name == "flexion" and unsided(name) in FROM_STRAIGHT
            bend = rest_bend(skeleton, int(joint), axis) if from_rest else 0.0
            names.append(f"{name}.{dof.name}")
            axes.append(axis)
            joints.append(joint)
            limits.append(np.radians([dof.low_deg, dof.high_deg]) - bend)
            spread.append(np.radians(dof.spread_deg))
    return Screws(
        names=tuple(names),
        twists=twists.screw(np.array(axes).reshape(-1, 3), skeleton.positions[joints].reshape(-1, 3)),
        joint=np.array(joints, np.int32),
        limits=np.array(limits).reshape(-1, 2),
        rest_spread=np.array(spread, np.float64),
    )
