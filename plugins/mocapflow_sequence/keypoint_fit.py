"""Poses and proportions that explain keypoints: damped Gauss-Newton with limits and stiffness as priors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.data import Body, Camera, Pose
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.cameras import projection
from mocapflow.model import moved
from mocapflow.records import F64, I32, array, record
from mocapflow_sequence.landmarks import Landmarks, landmarks
from mocapflow_sequence.proportions import scaled

FREE_SPREAD = np.radians(60.0)  # rad, of angles the body leaves free: unseen joints stay near rest
LIMIT_SPREAD = np.radians(2.0)  # rad, by how much an angle may pass a limit
DETECTOR_PX = 3.0  # px, of a keypoint against the place the estimator means
CAUCHY = 2.0  # standard deviations at which the weight of an observation has halved
ROUNDS, ENOUGH = 80, 1e-6  # Gauss-Newton steps; share of the cost below which a gain is none
STEP = 1e-4  # of a log proportion, for differences


@record
class Seen:
    """What is known of the landmarks of one frame, in the order of the landmarks."""

    position: F64 = array("L", 3, unit="m, NaN where not triangulated")
    pixels: F64 = array("C", "L", 2, unit="px")
    confidence: F64 = array("C", "L", unit="1, zero where unseen")


class Solution(NamedTuple):
    """Shared log proportions (P,) and the pose of each frame."""

    logs: F64
    poses: tuple[Pose, ...]


class _Observed(NamedTuple):
    """Residuals (N, m) of points, their derivatives (N, m, 3), the points they belong to and 1/sd (N,)."""

    error: F64
    slope: F64
    point: I32
    precision: F64


_Look = Callable[[F64, Seen], _Observed]


def fit(
    body: Body, frames: Sequence[Seen], cameras: Sequence[Camera], spreads: Mapping[str, float] | None = None
) -> tuple[Mapping[str, float], tuple[Pose, ...]]:
    """Return factors by proportion and the pose of each frame, of the body scaled by them.

    Args:
        body: the body before scaling.
        frames: the keypoints, in the order of `landmarks(body)`.
        cameras: pinhole cameras.
        spreads: the proportions to fit, with the standard deviation of their logarithm about zero.

    The triangulated points come first, for they can be reached from far away; then the pixels, which say how well
    each point is known.
    """
    marks, spreads = landmarks(body), dict(spreads or {})
    poses = tuple(Pose(root=_first_root(marks, seen), angles=np.zeros(len(body.twists))) for seen in frames)
    solution = Solution(np.zeros(len(spreads)), poses)
    for look in (_in_space(marks), _in_images(marks, cameras)):
        solution = _descend(marks, frames, look, solution, spreads)
    return dict(zip(spreads, np.exp(solution.logs).tolist(), strict=True)), solution.poses


def _descend(
    marks: Landmarks, frames: Sequence[Seen], look: _Look, solution: Solution, spreads: Mapping[str, float]
) -> Solution:
    """Levenberg-Marquardt over all frames at once; the poses are eliminated frame by frame (Schur complement)."""
    damping, cost = 1e-3, _cost(marks, frames, look, solution, spreads)
    for _ in range(ROUNDS):
        blocks = [_normal(marks, seen, look, solution, t, spreads) for t, seen in enumerate(frames)]
        while damping < 1e8:
            trial = _step(blocks, solution, spreads, damping)
            lower = _cost(marks, frames, look, trial, spreads)
            if lower <= cost:
                break
            damping *= 8
        else:
            return solution
        gain, cost, solution, damping = cost - lower, lower, trial, max(damping / 5, 1e-9)
        if gain < ENOUGH * cost:
            return solution
    return solution


def _step(
    blocks: Sequence[tuple[F64, F64]], solution: Solution, spreads: Mapping[str, float], damping: float
) -> Solution:
    shared = len(spreads)
    precision = np.array([1 / sd**2 for sd in spreads.values()])
    left, right = np.diag(precision * (1 + damping)), -precision * solution.logs
    solved = []
    for matrix, vector in blocks:
        pose = matrix[shared:, shared:] + damping * np.diag(np.diag(matrix[shared:, shared:]))
        both = np.linalg.solve(pose, np.column_stack([matrix[shared:, :shared], -vector[shared:]]))
        left = left + matrix[:shared, :shared] - matrix[:shared, shared:] @ both[:, :shared]
        right = right - vector[:shared] - matrix[:shared, shared:] @ both[:, -1]
        solved.append(both)
    logs = np.linalg.solve(left, right) if shared else np.empty(0)
    steps = [np.asarray(both[:, -1] - both[:, :shared] @ logs, np.float64) for both in solved]
    poses = tuple(moved(pose, step) for pose, step in zip(solution.poses, steps, strict=True))
    return Solution(solution.logs + logs, poses)


def _normal(
    marks: Landmarks, seen: Seen, look: _Look, solution: Solution, t: int, spreads: Mapping[str, float]
) -> tuple[F64, F64]:
    """Return the normal matrix and gradient of one frame over (log proportions, root, angles)."""
    pose = solution.poses[t]
    points, moves = _points(marks, pose, solution.logs, spreads)
    observed = look(points, seen)
    jacobian = np.einsum("nmi,nis->nms", observed.slope, moves[observed.point])
    weight = observed.precision**2 / (1 + _squared(observed) / CAUCHY**2)
    matrix = np.einsum("n,nms,nmr->sr", weight, jacobian, jacobian, optimize=True)
    vector = np.einsum("n,nms,nm->s", weight, jacobian, observed.error, optimize=True)
    angles = slice(len(spreads) + 6, None)
    error, precision = _prior(marks.body, pose.angles)
    matrix[angles, angles] += np.diag((precision**2).sum(axis=0))
    vector[angles] += (precision**2 * error).sum(axis=0)
    return matrix + 1e-6 * np.eye(len(vector)), vector


def _cost(
    marks: Landmarks, frames: Sequence[Seen], look: _Look, solution: Solution, spreads: Mapping[str, float]
) -> float:
    cost = 0.5 * sum((log / sd) ** 2 for log, sd in zip(solution.logs, spreads.values(), strict=True))
    body = scaled(marks.body, dict(zip(spreads, np.exp(solution.logs), strict=True)))
    for seen, pose in zip(frames, solution.poses, strict=True):
        observed = look(kinematics.skin(body, kinematics.chain(body, pose)[0]), seen)
        error, precision = _prior(body, pose.angles)
        cost += 0.5 * CAUCHY**2 * np.log1p(_squared(observed) / CAUCHY**2).sum()
        cost += 0.5 * ((precision * error) ** 2).sum()
    return float(cost)


def _squared(observed: _Observed) -> F64:
    return np.asarray((observed.error**2).sum(axis=1) * observed.precision**2)


def _prior(body: Body, angles: F64) -> tuple[F64, F64]:
    """Return errors (2, D) and 1/sd (2, D): distance from rest, and beyond the limits."""
    beyond = angles - np.clip(angles, *body.limits.T)
    spread = np.where(np.isfinite(body.rest_spread), body.rest_spread, FREE_SPREAD)
    return np.stack([angles, beyond]), np.stack([1 / spread, np.where(beyond == 0, 0.0, 1 / LIMIT_SPREAD)])


def _points(marks: Landmarks, pose: Pose, logs: F64, spreads: Mapping[str, float]) -> tuple[F64, F64]:
    """Return the landmarks (L, 3) m and their velocities (L, 3, P + 6 + D)."""

    def at(shift: F64) -> tuple[Body, F64, F64, F64]:
        body = scaled(marks.body, dict(zip(spreads, np.exp(logs + shift), strict=True)))
        joints, screws = kinematics.chain(body, pose)
        return body, kinematics.skin(body, joints), joints, screws

    body, points, _, screws = at(np.zeros(len(logs)))
    moves = np.zeros((len(points), 3, len(logs) + 6 + len(screws)))
    for k, step in enumerate(STEP * np.eye(len(logs))):
        moves[:, :, k] = (at(step)[1] - at(-step)[1]) / (2 * STEP)
    free = moves[:, :, len(logs) :]
    free[:, :, :3], free[:, :, 3:6] = -twists.hat(points), np.eye(3)
    below = kinematics.descendants(body.parents)[body.screw_joint][:, body.skin_joint[:, 0]]  # (D, L)
    turn = np.cross(screws[:, None, :3], points[None]) + screws[:, None, 3:]
    free[:, :, 6:] = np.moveaxis(turn * below[..., None], 0, -1)
    return points, moves


def _in_space(marks: Landmarks) -> _Look:
    def look(points: F64, seen: Seen) -> _Observed:
        known = np.flatnonzero(np.isfinite(seen.position).all(axis=1)).astype(np.int32)
        slope = np.broadcast_to(np.eye(3), (len(known), 3, 3))
        return _Observed(points[known] - seen.position[known], slope, known, 1 / marks.spread[known])

    return look


def _in_images(marks: Landmarks, cameras: Sequence[Camera]) -> _Look:
    matrices = np.stack([projection(camera) for camera in cameras])
    focal = np.array([camera.intrinsics[0, 0] for camera in cameras])

    def look(points: F64, seen: Seen) -> _Observed:
        camera, point = np.nonzero(seen.confidence > 0)
        homogeneous = np.einsum("nab,nb->na", matrices[camera, :, :3], points[point]) + matrices[camera, :, 3]
        depth = np.maximum(homogeneous[:, 2], 0.1)
        pixel = homogeneous[:, :2] / depth[:, None]
        slope = (matrices[camera, :2, :3] - pixel[..., None] * matrices[camera, 2:, :3]) / depth[:, None, None]
        spread = np.hypot(DETECTOR_PX, marks.spread[point] * focal[camera] / depth)
        precision = np.sqrt(np.clip(seen.confidence[camera, point], 0.0, 1.0)) / spread
        return _Observed(pixel - seen.pixels[camera, point], slope, point.astype(np.int32), precision)

    return look


def _first_root(marks: Landmarks, seen: Seen) -> F64:
    """Return the rigid motion of the trunk at rest on to its triangulated landmarks (Kabsch)."""
    known = np.isfinite(seen.position).all(axis=1)
    trunk = known & np.array([name.startswith(("hip", "shoulder", "neck")) for name in marks.names])
    use = trunk if trunk.sum() >= 3 else known
    rest, found = marks.body.vertices[use], seen.position[use]
    middle, centre = rest.mean(axis=0), found.mean(axis=0)
    u, _, vt = np.linalg.svd((found - centre).T @ (rest - middle))
    root = np.eye(4)
    root[:3, :3] = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    root[:3, 3] = centre - root[:3, :3] @ middle
    return root
