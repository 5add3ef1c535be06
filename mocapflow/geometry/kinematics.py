"""The kinematic chain as a product of exponentials, and linear blend skinning."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from mocapflow.assets import Body
from mocapflow.data import Pose, PoseBatch
from mocapflow.errors import ShapeError
from mocapflow.geometry.twists import hat
from mocapflow.records import F64, I32, Bool


def chain(body: Body, pose: Pose) -> tuple[F64, F64]:
    """Return where each joint and each screw of the chain is.

    Returns:
        `joints` (J, 4, 4) m, world_from_rest of what moves with each joint, and `screws` (D, 6), the twist in the
        world by which a unit change of each angle moves everything below it.

    Source: Rosenhahn 2008, Eq. (12.8)
    """
    if len(pose.angles) != len(body.twists):
        raise ShapeError(f"a pose of {len(pose.angles)} angles; the body has {len(body.twists)}")
    joints = np.empty((len(body.parents), 4, 4))
    screws = np.empty((len(body.twists), 6))
    _chain(pose.root, pose.angles, body.twists, body.screw_joint, body.parents, joints, screws)
    return joints, screws


def chain_batch(body: Body, poses: PoseBatch) -> F64:
    """Return world_from_rest of each joint for B poses: (B, J, 4, 4) m."""
    joints = np.empty((len(poses.root), len(body.parents), 4, 4))
    screws = np.empty((len(body.twists), 6))
    for row in range(len(poses.root)):
        _chain(poses.root[row], poses.angles[row], body.twists, body.screw_joint, body.parents, joints[row], screws)
    return joints


def skin(body: Body, joints: F64, angles: F64) -> F64:
    """Return the posed body vertices (V, 3) m of a chain `joints` (J, 4, 4), by linear blend skinning.

    Args:
        body: the body at rest.
        joints: (J, 4, 4) m, world_from_rest of each joint.
        angles: (D,) rad, with one of which the shape of some bodies changes.
    """
    rest = rest_shape(body, angles)
    posed = np.empty_like(rest)
    _skin(rest, body.skin_joint, body.skin_weight, joints, posed)
    return posed


def rest_shape(body: Body, angles: F64) -> F64:
    """Return the vertices at rest (V, 3) m of the shape that the body has at joint angles (D,) rad."""
    if body.morph_offset is None:
        return body.vertices
    start, stop = body.morph_range
    share = np.clip((angles[body.morph_screw] - start) / (stop - start), 0.0, 1.0)
    shape: F64 = body.vertices + share * body.morph_offset
    shape.flags.writeable = False  # like the vertices of a body: compiled code tells the two apart
    return shape


def morph_rate(body: Body, angles: F64) -> F64 | None:
    """Return how the vertices at rest change with the angle that drives the morph: (V, 3) m/rad; None outside it."""
    start, stop = body.morph_range
    if body.morph_offset is None or not min(start, stop) < angles[body.morph_screw] < max(start, stop):
        return None
    return body.morph_offset / (stop - start)


def screw_velocities(screws: F64, points: F64, share: F64 | Bool) -> F64:
    """Return how points (N, 3) m in the world move with a unit change of each angle: (N, 3, D) m.

    Args:
        screws: (D, 6), see `chain`.
        points: where they are; of a point that several joints carry, where one of them would have it.
        share: (N, D) of its screw's motion that a point takes part in: 1 below the screw, 0 elsewhere; or the weight
            of the joint in place of 1.
    """
    rate = (np.cross(screws[None, :, :3], points[:, None]) + screws[None, :, 3:]) * share[..., None]
    return np.swapaxes(rate, 1, 2)


def skin_velocities(body: Body, joints: F64, screws: F64, angles: F64, vertices: I32 | None = None) -> F64:
    """Return how skinned vertices move with an increment (omega, v, angles): (N, 3, 6 + D) m.

    Each joint that carries a vertex moves its share of it as if it were fixed to that joint; an angle that changes the
    shape moves it besides.

    Args:
        body: at rest.
        joints: (J, 4, 4) m, see `chain`.
        screws: (D, 6), see `chain`.
        angles: (D,) rad.
        vertices: (N,), which ones; all of them without.
    """
    some = np.arange(len(body.vertices)) if vertices is None else vertices
    rest, carriers, weights = rest_shape(body, angles)[some], body.skin_joint[some], body.skin_weight[some]
    below = descendants(body.parents)[body.screw_joint]  # (D, J)
    velocities = np.zeros((len(some), 3, 6 + len(screws)))
    for joint, weight in zip(carriers.T, weights.T, strict=True):
        turns, shifts = joints[joint, :3, :3], joints[joint, :3, 3]
        place = np.einsum("nab,nb->na", turns, rest) + shifts
        velocities[:, :, :3] -= weight[:, None, None] * hat(place)
        velocities[:, :, 3:6] += weight[:, None, None] * np.eye(3)
        velocities[:, :, 6:] += screw_velocities(screws, place, (below[:, joint] * weight).T)
        if (rate := morph_rate(body, angles)) is not None:
            moved = np.einsum("nab,nb->na", turns, rate[some])
            velocities[:, :, 6 + body.morph_screw] += weight[:, None] * moved
    return velocities


def joint_positions(body: Body, joints: F64) -> F64:
    """Return the joint centres (..., J, 3) m of chains `joints` (..., J, 4, 4)."""
    rest = np.concatenate([body.positions, np.ones((len(body.positions), 1))], axis=1)
    positions: F64 = np.einsum("...jab,jb->...ja", joints[..., :3, :], rest)
    return positions


def joint_centres(body: Body, root: F64, angles: F64) -> F64:
    """Return the joint centres (T, J, 3) m of a motion: root (T, 4, 4) m and angles (T, D) rad."""
    return joint_positions(body, chain_batch(body, PoseBatch(root=root, angles=angles)))


def root_position(body: Body, root: F64) -> F64:
    """Return where the root joint is (..., 3) m for roots (..., 4, 4).

    Their translation alone is where rest has its origin, for most bodies on the floor: how far that has moved says more
    of how the pelvis is turned than of where it is.
    """
    position: F64 = root[..., :3, :3] @ body.positions[0] + root[..., :3, 3]
    return position


def part_of(body: Body, vertices: npt.NDArray[np.integer[Any]]) -> Body:
    """Return a body of the same joints with the given vertices alone, without faces."""
    offset, modes = body.morph_offset, body.shape_modes
    return replace(
        body, vertices=body.vertices[vertices], faces=np.empty((0, 3), np.int32),
        skin_joint=body.skin_joint[vertices], skin_weight=body.skin_weight[vertices], cut=body.cut[vertices],
        morph_offset=None if offset is None else offset[vertices],
        shape_modes=None if modes is None else modes[:, vertices],
    )  # fmt: skip


def descendants(parents: I32) -> Bool:
    """Return (J, J) booleans: [i, j] is True where joint j is joint i or below it."""
    count = len(parents)
    below = np.eye(count, dtype=bool)
    for joint in range(count):
        if parents[joint] >= 0:
            below[:, joint] |= below[:, parents[joint]]
    return below


@numba.njit(cache=True)
def _chain(root, angles, twists, screw_joint, parents, joints, screws):  # type: ignore[no-untyped-def]
    motion = np.empty((3, 4))
    step = np.empty((3, 4))
    product = np.empty((3, 4))
    screw = 0
    for joint in range(len(parents)):
        parent = parents[joint]
        for a in range(3):
            for b in range(4):
                motion[a, b] = root[a, b] if parent < 0 else joints[parent, a, b]
        while screw < len(screw_joint) and screw_joint[screw] == joint:
            _carry(motion, twists[screw], screws[screw])
            _exp_unit(twists[screw], angles[screw], step)
            _compose(motion, step, product)
            motion[:] = product
            screw += 1
        joints[joint, :3] = motion
        joints[joint, 3, :3] = 0.0
        joints[joint, 3, 3] = 1.0


@numba.njit(cache=True)
def _carry(motion, twist, out):  # type: ignore[no-untyped-def]
    """Write Ad_motion twist."""
    for a in range(3):
        out[a] = motion[a, 0] * twist[0] + motion[a, 1] * twist[1] + motion[a, 2] * twist[2]
        out[3 + a] = motion[a, 0] * twist[3] + motion[a, 1] * twist[4] + motion[a, 2] * twist[5]
    out[3] += motion[1, 3] * out[2] - motion[2, 3] * out[1]
    out[4] += motion[2, 3] * out[0] - motion[0, 3] * out[2]
    out[5] += motion[0, 3] * out[1] - motion[1, 3] * out[0]


@numba.njit(cache=True)
def _exp_unit(twist, angle, out):  # type: ignore[no-untyped-def]
    """Write exp(angle twist) of a zero-pitch unit twist: a turn about a fixed axis."""
    s, c = math.sin(angle), 1.0 - math.cos(angle)
    x, y, z = twist[0], twist[1], twist[2]
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)
    px, py, pz = y * twist[5] - z * twist[4], z * twist[3] - x * twist[5], x * twist[4] - y * twist[3]
    for a in range(3):  # (I - R)(omega x v): the point of the axis nearest the origin stays
        p = px if a == 0 else (py if a == 1 else pz)
        out[a, 3] = p - (out[a, 0] * px + out[a, 1] * py + out[a, 2] * pz)


@numba.njit(cache=True)
def _compose(left, right, out):  # type: ignore[no-untyped-def]
    for a in range(3):
        for b in range(4):
            out[a, b] = left[a, 0] * right[0, b] + left[a, 1] * right[1, b] + left[a, 2] * right[2, b]
        out[a, 3] += left[a, 3]


@numba.njit(cache=True)
def _skin(vertices, skin_joint, skin_weight, joints, out):  # type: ignore[no-untyped-def]
    for v in range(len(vertices)):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        px = py = pz = 0.0
        for k in range(skin_joint.shape[1]):
            w = skin_weight[v, k]
            if w == 0.0:
                continue
            m = joints[skin_joint[v, k]]
            px += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            py += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            pz += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        out[v, 0], out[v, 1], out[v, 2] = px, py, pz
