"""Joint angles between joint centres, as a clinician would read them, with their standard deviations.

A three-point angle is the angle between the way into a joint and the way out of it: 0 where the limb is straight.
Hip flexion is the angle of the thigh from straight down in the pelvis' own sagittal plane, forward positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mocapflow.data import Body, Pose
from mocapflow.geometry import kinematics, twists
from mocapflow.records import F64, array, record


class Definition(NamedTuple):
    """One angle: its column, the joints it lies between, and what is added (degrees)."""

    name: str
    points: tuple[str, ...]
    offset: float = 0.0


@record
class AngleSeries:
    """Angles over T frames."""

    names: tuple[str, ...]
    value: F64 = array("T", "A", unit="deg")
    sd: F64 = array("T", "A", unit="deg, standard deviation")


def definitions(joint_names: tuple[str, ...]) -> tuple[Definition, ...]:
    """Return the angles that a skeleton with these joints has, in the order of the columns."""
    wanted = [
        Definition(f"{name}_{side}", tuple(f"{joint}_{side}" for joint in joints), offset)
        for name, joints, offset in (
            ("knee_flexion", ("hip", "knee", "ankle"), 0.0),
            ("hip_flexion", ("hip", "knee"), 0.0),
            ("ankle", ("knee", "ankle", "toe"), -90.0),
            ("elbow", ("shoulder", "elbow", "wrist"), 0.0),
        )
        for side in ("l", "r")
    ]
    return tuple(d for d in wanted if set(d.points) <= set(joint_names))


def three_point(positions: F64) -> F64:
    """Return the angles in degrees between the way in and the way out of points (..., 3, 3): start, joint, end."""
    a, b = positions[..., 1, :] - positions[..., 0, :], positions[..., 2, :] - positions[..., 1, :]
    angle: F64 = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))
    return angle


def anatomical_axes(body: Body) -> F64:
    """Return the axes of the rest pose as rows: forward, up, right (3, 3), from the hips (or shoulders) and z up."""
    up = np.array([0.0, 0.0, 1.0])
    left = np.array([1.0, 0.0, 0.0])
    for pair in (("hip_l", "hip_r"), ("shoulder_l", "shoulder_r")):
        if set(pair) <= set(body.joint_names):
            across = body.positions[body.joint(pair[0])] - body.positions[body.joint(pair[1])]
            left = across - across @ up * up
            left = left / np.linalg.norm(left)
            break
    return np.stack([np.cross(left, up), up, -left])


def measure(body: Body, root: F64, angles: F64, covariance: F64 | None = None) -> AngleSeries:
    """Return the angles of a track and, by first-order propagation, their standard deviations.

    Args:
        body: the body.
        root: (T, 4, 4) m, world_from_body.
        angles: (T, D) rad.
        covariance: (T, 6 + D, 6 + D) of increments (omega, v, angles); without it the deviations are NaN.
    """
    wanted = definitions(body.joint_names)
    value, sd = np.empty((len(root), len(wanted))), np.full((len(root), len(wanted)), np.nan)
    axes = anatomical_axes(body)
    below = kinematics.descendants(body.parents)[body.screw_joint]  # (D, J)
    for row in range(len(root)):
        joints, screws = kinematics.chain(body, Pose(root=root[row].copy(), angles=angles[row].copy()))
        places = kinematics.joint_positions(body, joints)
        for column, wish in enumerate(wanted):
            value[row, column], gradient = _angle(body, wish, places, joints, axes, screws, below)
            if covariance is not None:
                variance = gradient @ covariance[row] @ gradient
                sd[row, column] = np.degrees(np.sqrt(max(variance, 0.0)))
    return AngleSeries(names=tuple(d.name for d in wanted), value=value, sd=sd)


def _angle(
    body: Body, wish: Definition, places: F64, joints: F64, axes: F64, screws: F64, below: F64
) -> tuple[float, F64]:
    """Return one angle (degrees) and its gradient (6 + D,) in rad per unit of increment."""
    index = [body.joint(name) for name in wish.points]
    moves = [_velocity(places[j], screws, below[:, j]) for j in index]
    if len(index) == 3:
        a, b = places[index[1]] - places[index[0]], places[index[2]] - places[index[1]]
        by_a, by_b = _angle_between(a, b)
        gradient = by_a @ (moves[1] - moves[0]) + by_b @ (moves[2] - moves[1])
        return float(three_point(places[index])) + wish.offset, gradient
    pelvis = int(body.parents[index[0]])
    rotation = joints[pelvis, :3, :3]
    thigh = places[index[1]] - places[index[0]]
    forward, down = axes[0] @ rotation.T @ thigh, -axes[1] @ rotation.T @ thigh
    turn = np.concatenate([np.eye(3), np.zeros((3, 3)), np.where(below[:, pelvis], screws[:, :3].T, 0.0)], axis=1)
    relative = moves[1] - moves[0] + twists.hat(thigh) @ turn  # how the thigh moves as seen from the pelvis
    gradient = (down * axes[0] + forward * axes[1]) @ rotation.T @ relative / (forward**2 + down**2)
    return float(np.degrees(np.arctan2(forward, down))), gradient


def _velocity(point: F64, screws: F64, moved: F64) -> F64:
    """Return how a joint centre moves with an increment: (3, 6 + D)."""
    by_screws = np.where(moved, (np.cross(screws[:, :3], point) + screws[:, 3:]).T, 0.0)
    return np.concatenate([-twists.hat(point), np.eye(3), by_screws], axis=1)


def _angle_between(a: F64, b: F64) -> tuple[F64, F64]:
    """Return the gradients of the angle between two vectors; straight limbs bend in any one plane."""
    normal = np.cross(a, b)
    if np.linalg.norm(normal) < 1e-12 * np.linalg.norm(a) * np.linalg.norm(b):
        normal = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
    normal = normal / np.linalg.norm(normal)
    return np.cross(a, normal) / (a @ a), np.cross(normal, b) / (b @ b)
