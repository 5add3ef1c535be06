"""Normal equations of skinned points on a kinematic chain, summed over joints instead of rows.

A point X = sum_k w_k X_k is carried by its joints k. A unit of the screw s moves X_k by omega x X_k + v if joint k is
below the screw, so a row with gradient g has the derivative s . sum over the joints below of f_k, with the wrench
f_k = w_k (X_k x g, g). The Hessian is therefore s^T (sum of the blocks B_ij over joints i below s and j below t) t,
with B_ij the sum of f_i f_j^T over all rows: nothing per row depends on the number of angles.

Node 0 stands for the root, node j + 1 for joint j; the first six screws are the unit twists of the root. Everything
is about `centre`, near the person, so that turning and shifting hardly mix.

Source: Rosenhahn 2008, Eq. (12.8)
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from mocapflow.data import Body
from mocapflow.records import F64
from mocapflow_twist.constraint import Rows

BEHIND = 1e-6  # divisors below this are points behind a camera
WIDE = 8  # six components of a wrench and two zeros: whole vector registers


class Equations(NamedTuple):
    """A quadratic model of a cost: energy + gradient . z + z . hessian . z / 2."""

    hessian: F64  # (S, S)
    gradient: F64  # (S,)
    energy: float


def about(screws: F64, centre: F64) -> F64:
    """Return twists (..., 6) in the world as twists about a point `centre` (3,) m."""
    moved = screws.copy()
    moved[..., 3:] += np.cross(screws[..., :3], centre)
    return moved


def body_equations(rows: Rows, body: Body, joints: F64, screws: F64, centre: F64) -> Equations:
    """Return the normal equations of rows on body vertices for an increment (6 + D,) about `centre`.

    Args:
        rows: rows on body vertices.
        body: the body.
        joints: (J, 4, 4) world_from_rest of each joint.
        screws: (D, 6) world twists of the angles.
        centre: (3,) m, the point about which the root's increment turns.
    """
    unknowns = 6 + len(screws)
    all_screws = np.empty((unknowns, 6))
    all_screws[:6], all_screws[6:] = np.eye(6), about(screws, centre)
    node = np.zeros(unknowns, np.int32)
    node[6:] = body.screw_joint + 1
    nodes = len(body.parents) + 1
    blocks, forces = np.zeros((nodes, nodes, 6, WIDE)), np.zeros((nodes, WIDE))
    energy = _sum_rows(
        rows.plane, rows.divisor, rows.vertex, rows.weight, body.vertices, body.skin_joint, body.skin_weight, joints,
        centre, blocks, forces,
    )  # fmt: skip
    hessian, gradient = np.empty((unknowns, unknowns)), np.empty(unknowns)
    _sum_below(body.parents, blocks, forces)
    _project(all_screws, node, blocks, forces, hessian, gradient)
    return Equations(hessian, gradient, energy)


def body_energy(rows: Rows, body: Body, joints: F64) -> float:
    """Return half the weighted squared error of rows on body vertices."""
    energy: float = _energy(
        rows.plane, rows.divisor, rows.vertex, rows.weight, body.vertices, body.skin_joint, body.skin_weight, joints
    )
    return energy


def point_errors(rows: Rows, points: F64) -> tuple[F64, F64]:
    """Return errors (R,) and gradients (R, 3) by the position of points (R, 3) m; zero behind a camera."""
    divisor = np.sum(rows.divisor[:, :3] * points, axis=1) + rows.divisor[:, 3]
    front = divisor > BEHIND
    scale = np.where(front, 1.0 / np.where(front, divisor, 1.0), 0.0)
    error = (np.sum(rows.plane[:, :3] * points, axis=1) + rows.plane[:, 3]) * scale
    gradient = (rows.plane[:, :3] - error[:, None] * rows.divisor[:, :3]) * scale[:, None]
    return error, gradient


def dense_equations(rows: Rows, points: F64, velocities: F64) -> Equations:
    """Return the normal equations of rows whose points (R, 3) move with velocities (R, 3, S)."""
    error, gradient = point_errors(rows, points)
    jacobian = np.einsum("ra,ras->rs", gradient, velocities)
    weighted = rows.weight[:, None] * jacobian
    return Equations(weighted.T @ jacobian, weighted.T @ error, 0.5 * float(rows.weight @ error**2))


@numba.njit(cache=True)
def _sum_rows(  # type: ignore[no-untyped-def]
    plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints, centre, blocks, forces
):
    """Add half of each f_i f_j^T to `blocks` (whole where i != j) and each error times f to `forces`."""
    width = skin_joint.shape[1]
    wrench = np.zeros((width, WIDE))
    at = np.empty((width, 3))
    share = np.empty(width)
    node = np.empty(width, np.int64)
    energy = 0.0
    for row in range(len(vertex)):
        v = vertex[row]
        rx, ry, rz = rest[v, 0], rest[v, 1], rest[v, 2]
        count = 0
        x = y = z = 0.0
        for k in range(width):
            w = skin_weight[v, k]
            if w == 0.0:
                continue
            m = joints[skin_joint[v, k]]
            px = m[0, 0] * rx + m[0, 1] * ry + m[0, 2] * rz + m[0, 3]
            py = m[1, 0] * rx + m[1, 1] * ry + m[1, 2] * rz + m[1, 3]
            pz = m[2, 0] * rx + m[2, 1] * ry + m[2, 2] * rz + m[2, 3]
            x, y, z = x + w * px, y + w * py, z + w * pz
            at[count, 0], at[count, 1], at[count, 2] = px - centre[0], py - centre[1], pz - centre[2]
            share[count], node[count] = w, skin_joint[v, k] + 1
            count += 1
        a, b = plane[row], divisor[row]
        depth = b[0] * x + b[1] * y + b[2] * z + b[3]
        if depth < BEHIND:
            continue
        error = (a[0] * x + a[1] * y + a[2] * z + a[3]) / depth
        gx, gy, gz = (a[0] - error * b[0]) / depth, (a[1] - error * b[1]) / depth, (a[2] - error * b[2]) / depth
        certainty = weight[row]
        energy += 0.5 * certainty * error * error
        for i in range(count):
            s = share[i]
            wrench[i, 0] = s * (at[i, 1] * gz - at[i, 2] * gy)
            wrench[i, 1] = s * (at[i, 2] * gx - at[i, 0] * gz)
            wrench[i, 2] = s * (at[i, 0] * gy - at[i, 1] * gx)
            wrench[i, 3], wrench[i, 4], wrench[i, 5] = s * gx, s * gy, s * gz
            force = forces[node[i]]
            for c in range(WIDE):
                force[c] += certainty * error * wrench[i, c]
            for j in range(i + 1):
                block = blocks[node[i], node[j]]
                scale = 0.5 * certainty if i == j else certainty
                for r in range(6):
                    f = scale * wrench[i, r]
                    for c in range(WIDE):
                        block[r, c] += f * wrench[j, c]
    return energy


@numba.njit(cache=True)
def _energy(plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints):  # type: ignore[no-untyped-def]
    energy = 0.0
    for row in range(len(vertex)):
        v = vertex[row]
        rx, ry, rz = rest[v, 0], rest[v, 1], rest[v, 2]
        x = y = z = 0.0
        for k in range(skin_joint.shape[1]):
            w = skin_weight[v, k]
            if w == 0.0:
                continue
            m = joints[skin_joint[v, k]]
            x += w * (m[0, 0] * rx + m[0, 1] * ry + m[0, 2] * rz + m[0, 3])
            y += w * (m[1, 0] * rx + m[1, 1] * ry + m[1, 2] * rz + m[1, 3])
            z += w * (m[2, 0] * rx + m[2, 1] * ry + m[2, 2] * rz + m[2, 3])
        a, b = plane[row], divisor[row]
        depth = b[0] * x + b[1] * y + b[2] * z + b[3]
        if depth >= BEHIND:
            error = (a[0] * x + a[1] * y + a[2] * z + a[3]) / depth
            energy += 0.5 * weight[row] * error * error
    return energy


@numba.njit(cache=True)
def _sum_below(parents, blocks, forces):  # type: ignore[no-untyped-def]
    """Add to every node what its descendants have, along both axes of `blocks`."""
    for joint in range(len(parents) - 1, -1, -1):
        node, above = joint + 1, parents[joint] + 1
        for c in range(WIDE):
            forces[above, c] += forces[node, c]
        for other in range(len(parents) + 1):
            for r in range(6):
                for c in range(WIDE):
                    blocks[above, other, r, c] += blocks[node, other, r, c]
    for joint in range(len(parents) - 1, -1, -1):
        node, above = joint + 1, parents[joint] + 1
        for other in range(len(parents) + 1):
            for r in range(6):
                for c in range(WIDE):
                    blocks[other, above, r, c] += blocks[other, node, r, c]


@numba.njit(cache=True)
def _project(screws, node, blocks, forces, hessian, gradient):  # type: ignore[no-untyped-def]
    """Write s^T (B + B^T) t for every two screws and s . f for every screw."""
    unknowns = len(screws)
    carried = np.empty((len(blocks), WIDE))
    for s in range(unknowns):
        total = 0.0
        for c in range(6):
            total += screws[s, c] * forces[node[s], c]
        gradient[s] = total
        carried[:] = 0.0
        for n in range(len(blocks)):
            block = blocks[node[s], n]
            for r in range(6):
                f = screws[s, r]
                for c in range(WIDE):
                    carried[n, c] += f * block[r, c]
        for t in range(unknowns):
            total = 0.0
            for c in range(6):
                total += carried[node[t], c] * screws[t, c]
            hessian[s, t] = total
    for s in range(unknowns):
        for t in range(s + 1):
            both = hessian[s, t] + hessian[t, s]
            hessian[s, t] = both
            hessian[t, s] = both
