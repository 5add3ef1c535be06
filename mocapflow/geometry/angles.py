"""Joint angles between joint centres, as a clinician would read them, with their standard deviations.

A three-point angle is the angle between the way into a joint and the way out of it: 0 where the limb is straight.
Hip flexion is the angle of the thigh from straight down in the pelvis' own sagittal plane, forward positive.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.skeleton import body_directions, skeleton_of
from mocapflow.records import F64, Bool, array, record
from mocapflow.series import Wide

STRAIGHT = 1e-12  # sine of the angle below which the limbs span no plane
UNMOVED = 1e-9  # rad per rad; a screw that changes an angle by less does not change it


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
    observed: F64 = array("T", "A", unit="1, share that the images determined; the rest is the priors'")


def definitions(joint_names: tuple[str, ...]) -> tuple[Definition, ...]:
    """Return the angles that a skeleton with these joints has, in the order of the columns."""
    return tuple(d for d in _all_definitions() if set(d.points) <= set(joint_names))


def unmeasured(joint_names: tuple[str, ...], whole: bool = True) -> str:
    """Say which angles a skeleton with these joints lacks, and for want of which joints; "" where it has all.

    Of a part of a skeleton, those are told of which it has some joint.
    """
    lost = [d for d in _all_definitions() if not set(d.points) <= set(joint_names)]
    lost = [d for d in lost if whole or not set(d.points).isdisjoint(joint_names)]
    joints = dict.fromkeys(point for d in lost for point in d.points if point not in joint_names)
    said = f"no angles {', '.join(d.name for d in lost)}: the skeleton has no joints named {', '.join(joints)}"
    return said if lost else ""


def _all_definitions() -> list[Definition]:
    return [
        Definition(f"{name}_{side}", tuple(f"{joint}_{side}" for joint in joints), offset)
        for name, joints, offset in (
            ("knee_flexion", ("hip", "knee", "ankle"), 0.0),
            ("hip_flexion", ("hip", "knee"), 0.0),
            ("ankle", ("knee", "ankle", "toe"), -90.0),
            ("elbow", ("shoulder", "elbow", "wrist"), 0.0),
        )
        for side in ("l", "r")
    ]


def three_point(positions: F64) -> F64:
    """Return the angles in degrees between the way in and the way out of points (..., 3, 3): start, joint, end."""
    a, b = positions[..., 1, :] - positions[..., 0, :], positions[..., 2, :] - positions[..., 1, :]
    angle: F64 = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))
    return angle


def hip_flexion(thigh: F64, pelvis: F64) -> F64:
    """Return the hip flexion (...,) in degrees of thighs (..., 3), by the pelvis' forward and up (..., 2, 3)."""
    forward, up = np.einsum("...ac,...c->a...", pelvis, thigh)
    angle: F64 = np.degrees(np.arctan2(forward, -up))
    return angle


def between_centres(places: Mapping[str, F64]) -> dict[str, F64]:
    """Return the three-point angles (T,) in degrees that joint centres (T, 3) by name allow."""
    return {
        angle.name: three_point(np.stack([places[point] for point in angle.points], axis=1)) + angle.offset
        for angle in definitions(tuple(places))
        if len(angle.points) == 3
    }


def anatomical_axes(body: Body) -> F64:
    """Return the axes of the rest pose as rows: forward, up, right (3, 3); see `body_directions`."""
    forward, left, up = body_directions(skeleton_of(body))
    return np.stack([forward, up, -left])


def measure(
    body: Body, root: F64, angles: F64, covariance: Wide | None = None, observed: F64 | None = None
) -> AngleSeries:
    """Return the angles of a track, by first-order propagation their standard deviations, and what was seen of them.

    Both are NaN for an angle that no screw changes.

    Args:
        body: the body.
        root: (T, 4, 4) m, world_from_body.
        angles: (T, D) rad.
        covariance: (T, 6 + D, 6 + D) of increments (omega, v, angles); without it the deviations are NaN.
        observed: (T, D) share of each joint angle that the images determined; without it those of the result are NaN.
    """
    wanted = definitions(body.joint_names)
    value = np.empty((len(root), len(wanted)))
    sd, share = np.full_like(value, np.nan), np.full_like(value, np.nan)
    sagittal = anatomical_axes(body)[:2]
    below = kinematics.descendants(body.parents)[body.screw_joint]
    for row in range(len(root)):
        pose = Pose(root=root[row].copy(), angles=angles[row].copy())
        for column, (angle, gradient) in enumerate(_angles_of(body, pose, wanted, sagittal, below)):
            value[row, column] = angle
            if np.abs(gradient[6:]).max(initial=0.0) < UNMOVED:
                continue
            if covariance is not None:
                variance = float(gradient @ covariance[row] @ gradient)
                sd[row, column] = np.degrees(np.sqrt(max(variance, 0.0)))
            if observed is not None:
                share[row, column] = np.average(observed[row], weights=gradient[6:] ** 2)
    return AngleSeries(names=tuple(d.name for d in wanted), value=value, sd=sd, observed=share)


def _angles_of(
    body: Body, pose: Pose, wanted: Sequence[Definition], sagittal: F64, below: Bool
) -> Iterator[tuple[float, F64]]:
    """Yield angles (degrees) of a pose, each with its gradient (6 + D,) in rad.

    `sagittal` (2, 3) holds forward and up at rest; `below` (D, J) is True where a screw moves a joint.
    """
    joints, screws = kinematics.chain(body, pose)
    places = kinematics.joint_positions(body, joints)
    moves = _velocities(places, screws, below)
    for angle in wanted:
        index = [body.joint(name) for name in angle.points]
        if len(index) == 3:
            yield float(three_point(places[index])) + angle.offset, _three_point_gradient(places[index], moves[index])
        else:
            pelvis = max(int(body.parents[index[0]]), 0)  # a leg alone hangs on nothing
            turn = np.hstack([np.eye(3), np.zeros((3, 3)), np.where(below[:, pelvis], screws[:, :3].T, 0.0)])
            seen_from = sagittal @ joints[pelvis, :3, :3].T  # the pelvis' forward and up, in the world
            yield _flexion(places[index], moves[index], seen_from, turn)


def _velocities(places: F64, screws: F64, below: Bool) -> F64:
    """Return how each joint centre moves with an increment: (J, 3, 6 + D)."""
    count = len(places)
    by_screws = kinematics.screw_velocities(screws, places, below.T)
    identity = np.broadcast_to(np.eye(3), (count, 3, 3))
    return np.concatenate([-twists.hat(places), identity, by_screws], axis=2)


def _three_point_gradient(places: F64, moves: F64) -> F64:
    """Return the gradient (6 + D,) of a three-point angle in rad; a straight limb bends as its joint turns it most."""
    a, b = places[1] - places[0], places[2] - places[1]
    by_a, by_b = moves[1] - moves[0], moves[2] - moves[1]
    long_a, long_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    normal = np.cross(a, b)
    if np.linalg.norm(normal) < STRAIGHT * long_a * long_b:
        turn = by_b / long_b - by_a / long_a
        _, size, ways = np.linalg.svd(turn - np.outer(a, a @ turn) / long_a**2, full_matrices=False)
        return np.asarray(size[0] * ways[0])
    normal /= np.linalg.norm(normal)
    gradient: F64 = np.cross(a, normal) @ by_a / long_a**2 + np.cross(normal, b) @ by_b / long_b**2
    return gradient


def _flexion(places: F64, moves: F64, pelvis: F64, turn: F64) -> tuple[float, F64]:
    """Return the hip flexion (degrees) and its gradient (6 + D,) in rad.

    Args:
        places: (2, 3) m, hip and knee.
        moves: (2, 3, 6 + D), how they move.
        pelvis: (2, 3), its forward and up in the world.
        turn: (3, 6 + D), how it turns.
    """
    thigh = places[1] - places[0]
    forward, up = pelvis @ thigh
    relative = moves[1] - moves[0] + twists.hat(thigh) @ turn  # how the thigh moves as seen from the pelvis
    gradient = (-up * pelvis[0] + forward * pelvis[1]) @ relative / (forward**2 + up**2)
    return float(hip_flexion(thigh, pelvis)), gradient
