"""Compiled sums over rows and joints; `normal_equations` says what they mean."""

from __future__ import annotations

import math

import numba
import numpy as np

from mocapflow_twist.registers import LANES, add_scaled

BEHIND = 1e-6  # divisors below this are points behind a camera

index = numba.uint64  # of an array: unsigned, so that nothing is checked for counting from the end


@numba.njit(cache=True)
def equations(  # type: ignore[no-untyped-def]
    plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints, parents, screws, screw_joint, centre,
    hessian, gradient,
):  # fmt: skip
    """Write the normal equations and return half the weighted squared error."""
    nodes = len(parents) + 1
    blocks = np.zeros((nodes, 6, nodes, LANES))  # half of B: [i, :, j] of either (i, j) or (j, i), half of [i, :, i]
    forces = np.zeros((nodes, LANES))
    half_squares = _sum_rows(
        plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints, centre, blocks.reshape(-1),
        forces.reshape(-1),
    )  # fmt: skip
    about = np.zeros((6 + len(screws), 6))
    node = np.zeros(len(about), np.int64)
    for s in range(6):
        about[s, s] = 1.0
    for s in range(len(screws)):
        x, y, z = screws[s, 0], screws[s, 1], screws[s, 2]
        node[6 + s] = screw_joint[s] + 1
        about[6 + s] = screws[s]
        about[6 + s, 3] += y * centre[2] - z * centre[1]
        about[6 + s, 4] += z * centre[0] - x * centre[2]
        about[6 + s, 5] += x * centre[1] - y * centre[0]
    _project(parents, about, node, blocks.reshape((nodes, 6, -1)), forces, hessian, gradient)
    return half_squares


@numba.njit(cache=True)
def _sum_rows(  # type: ignore[no-untyped-def]
    plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints, centre, blocks, forces
):
    """Add half the sum of f_i f_j^T to `blocks`, and each error times f to `forces`; both flat."""
    width, nodes = skin_joint.shape[1], len(joints) + 1
    at, share, node = np.empty((width, 3)), np.empty(width), np.empty(width, np.int64)
    wrench = np.zeros(width * LANES)
    cx, cy, cz = centre[0], centre[1], centre[2]
    energy = 0.0
    for row in range(len(vertex)):
        v = index(vertex[row])
        rx, ry, rz = rest[v, 0], rest[v, 1], rest[v, 2]
        count = 0
        x = y = z = 0.0
        for k in range(width):
            w = skin_weight[v, k]
            if w == 0.0:
                continue
            n = index(skin_joint[v, k])
            px = joints[n, 0, 0] * rx + joints[n, 0, 1] * ry + joints[n, 0, 2] * rz + joints[n, 0, 3]
            py = joints[n, 1, 0] * rx + joints[n, 1, 1] * ry + joints[n, 1, 2] * rz + joints[n, 1, 3]
            pz = joints[n, 2, 0] * rx + joints[n, 2, 1] * ry + joints[n, 2, 2] * rz + joints[n, 2, 3]
            x, y, z = x + w * px, y + w * py, z + w * pz
            at[count, 0], at[count, 1], at[count, 2] = px - cx, py - cy, pz - cz
            share[count], node[count] = w, skin_joint[v, k] + 1
            count += 1
        depth = divisor[row, 0] * x + divisor[row, 1] * y + divisor[row, 2] * z + divisor[row, 3]
        if depth < BEHIND:
            continue
        near = 1.0 / depth
        error = (plane[row, 0] * x + plane[row, 1] * y + plane[row, 2] * z + plane[row, 3]) * near
        gx = (plane[row, 0] - error * divisor[row, 0]) * near
        gy = (plane[row, 1] - error * divisor[row, 1]) * near
        gz = (plane[row, 2] - error * divisor[row, 2]) * near
        certainty = weight[row]
        energy += 0.5 * certainty * error * error
        for i in range(count):
            s, f = share[i], i * LANES
            wrench[f] = s * (at[i, 1] * gz - at[i, 2] * gy)
            wrench[f + 1] = s * (at[i, 2] * gx - at[i, 0] * gz)
            wrench[f + 2] = s * (at[i, 0] * gy - at[i, 1] * gx)
            wrench[f + 3], wrench[f + 4], wrench[f + 5] = s * gx, s * gy, s * gz
            add_scaled(forces, node[i] * LANES, certainty * error, wrench, f)
            for j in range(i + 1):
                half = 0.5 * certainty if i == j else certainty
                for r in range(6):
                    block = ((node[i] * 6 + r) * nodes + node[j]) * LANES
                    add_scaled(blocks, block, half * wrench[f + r], wrench, j * LANES)
    return energy


@numba.njit(cache=True)
def _project(parents, screws, node, blocks, forces, hessian, gradient):  # type: ignore[no-untyped-def]
    """Write s^T (B + B^T) t for every two screws, with B summed below both, and s . f for every screw."""
    for n in range(len(parents), 0, -1):  # children before parents: each node gets what is below it
        above = parents[n - 1] + 1
        forces[above] += forces[n]
        for r in range(6):
            blocks[above, r] += blocks[n, r]
    carried = np.empty((len(parents) + 1, LANES))
    flat = carried.reshape(-1)
    for s in range(len(screws)):
        f, b = screws[s], blocks[node[s]]
        gradient[s] = 0.0
        for c in range(6):
            gradient[s] += f[c] * forces[node[s], c]
        for k in range(len(flat)):
            flat[k] = (
                f[0] * b[0, k] + f[1] * b[1, k] + f[2] * b[2, k] + f[3] * b[3, k] + f[4] * b[4, k] + f[5] * b[5, k]
            )
        for n in range(len(parents), 0, -1):
            add_scaled(flat, (parents[n - 1] + 1) * LANES, 1.0, flat, n * LANES)
        for t in range(len(screws)):
            g, h = screws[t], carried[node[t]]
            hessian[s, t] = g[0] * h[0] + g[1] * h[1] + g[2] * h[2] + g[3] * h[3] + g[4] * h[4] + g[5] * h[5]
    for s in range(len(screws)):
        for t in range(s + 1):
            both = hessian[s, t] + hessian[t, s]
            hessian[s, t] = both
            hessian[t, s] = both


@numba.njit(cache=True)
def energy(plane, divisor, vertex, weight, rest, skin_joint, skin_weight, joints):  # type: ignore[no-untyped-def]
    """Return half the weighted squared error."""
    energy = 0.0
    for row in range(len(vertex)):
        v = index(vertex[row])
        rx, ry, rz = rest[v, 0], rest[v, 1], rest[v, 2]
        x = y = z = 0.0
        for k in range(skin_joint.shape[1]):
            w = skin_weight[v, k]
            if w == 0.0:
                continue
            m = joints[index(skin_joint[v, k])]
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
def image_planes(camera, pixel, direction, matrices):  # type: ignore[no-untyped-def]
    """Return the plane (R, 4) through each image line across `direction` at `pixel`, that of its depth, and its match.

    Matches without direction have a second line, after all others: first across x, then across y.
    """
    free = 0
    for m in range(len(camera)):
        free += direction[m, 0] == 0.0 and direction[m, 1] == 0.0
    plane, divisor = np.empty((len(camera) + free, 4)), np.empty((len(camera) + free, 4))
    match = np.arange(len(camera) + free).astype(np.int32)
    second = len(camera)
    for m in range(len(camera)):
        dx, dy, matrix = direction[m, 0], direction[m, 1], matrices[camera[m]]
        if dx == 0.0 and dy == 0.0:
            _image_plane(pixel[m], 0.0, 1.0, matrix, plane[second], divisor[second])
            match[second] = m
            second += 1
            dx = 1.0
        _image_plane(pixel[m], dx, dy, matrix, plane[m], divisor[m])
    return plane, divisor, match


@numba.njit(cache=True)
def _image_plane(pixel, dx, dy, matrix, plane, divisor):  # type: ignore[no-untyped-def]
    offset = dx * pixel[0] + dy * pixel[1]
    for k in range(4):
        plane[k] = dx * matrix[0, k] + dy * matrix[1, k] - offset * matrix[2, k]
        divisor[k] = matrix[2, k]


@numba.njit(cache=True)
def clustering(camera, pixel, weight, size, cells):  # type: ignore[no-untyped-def]
    """Return per view (V,) the sum of squared weights, and of squared sums in square cells, the mean of two grids.

    There are `cells` of `size` px along an axis of a grid, then they repeat.
    """
    views = camera.max() + 1 if len(camera) else 0
    alone, clustered = np.zeros(views), np.zeros(views)
    for shift in (0.0, 0.5):
        sums = np.zeros((views, cells, cells))
        for m in range(len(camera)):
            view, here = camera[m], weight[m]
            column = math.floor(pixel[m, 0] / size + shift) % cells
            row = math.floor(pixel[m, 1] / size) % cells
            before = sums[view, row, column]
            sums[view, row, column] = before + here
            clustered[view] += 0.5 * here * (2.0 * before + here)  # half of what the square grows by
            alone[view] += 0.5 * here * here
    return alone, clustered


@numba.njit(cache=True)
def jacobian(gradient, velocity, vertex, out):  # type: ignore[no-untyped-def]
    """Write the derivatives (R, S) of rows by the unknowns.

    From gradients (R, 3) by the place of the vertices (R,), and what these move by (W, 3, S).
    """
    for row in range(len(vertex)):
        x, y, z = gradient[row]
        vx, vy, vz = velocity[vertex[row], 0], velocity[vertex[row], 1], velocity[vertex[row], 2]
        line = out[row]
        for s in range(line.size):
            line[s] = x * vx[s] + y * vy[s] + z * vz[s]
