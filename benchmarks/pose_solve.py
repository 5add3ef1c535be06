"""Gauss–Newton step of the pose solver against scipy and numpy: 2,400 residuals, 30 angles and the root.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/pose_solve.py`. Every solver minimises the same
distances in the image from the same start; the table gives CPU ms for an iteration and how far its answer is from
that of the pose solver. First with the skinning weights of the demo body (a third of the vertices hang on two to five
joints), then with one joint for each vertex.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_twist import normal_equations, steps
from mocapflow_twist.constraint import Rows, image_rows
from scipy.optimize import least_squares

from mocapflow.assets import Body
from mocapflow.data import Matches, Pose
from mocapflow.geometry import cameras, kinematics, twists
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.model import moved
from mocapflow.records import F64

DEMO = Path(__file__).parents[1] / "examples" / "data" / "skirt_steps"
ROWS, ANGLES, NOISE_PX, OFF = 2400, 30, 0.7, 0.03


class Task(NamedTuple):
    """Rows seen of a person, and where the solvers start."""

    body: Body
    rows: Rows
    start: Pose


def make_task(rigid: bool) -> Task:
    rng = np.random.default_rng(0)
    body = thirty_angles(Scanned().load(DEMO), rigid)
    views = read_cameras(DEMO)
    root = np.eye(4)
    truth = Pose(root=root, angles=rng.normal(size=ANGLES) * 0.2)
    per_view = ROWS // len(views)
    vertex = np.concatenate([np.sort(rng.choice(len(body.vertices), per_view, replace=False)) for _ in views])
    posed = kinematics.skin(body, kinematics.chain(body, truth)[0], truth.angles)
    points = posed[vertex].reshape(len(views), per_view, 3)
    pixel = np.concatenate([cameras.project(p, c) for p, c in zip(points, views, strict=True)])
    direction = rng.normal(size=pixel.shape)
    matches = Matches(
        camera=np.repeat(np.arange(len(views), dtype=np.int16), per_view),
        pixel=pixel + rng.normal(size=pixel.shape) * NOISE_PX,
        direction=direction / np.linalg.norm(direction, axis=1, keepdims=True),
        vertex=vertex.astype(np.int32),
        weight=np.ones(ROWS),
    )
    start = apply(truth, rng.normal(size=6 + ANGLES) * OFF)
    return Task(body, image_rows(matches, views), start)


def thirty_angles(body: Body, rigid: bool) -> Body:
    """The same body with the first 30 of its angles that are free, and perhaps one joint for each vertex."""
    free = np.isinf(body.rest_spread)
    kept = np.sort(np.argsort(~free, kind="stable")[:ANGLES])
    weight = (np.arange(5) == body.skin_weight.argmax(axis=1)[:, None]).astype(float)
    return replace(
        body, screw_names=tuple(body.screw_names[k] for k in kept), twists=body.twists[kept],
        screw_joint=body.screw_joint[kept], limits=body.limits[kept], rest_spread=body.rest_spread[kept],
        skin_weight=weight if rigid else body.skin_weight,
    )  # fmt: skip


def apply(pose: Pose, increment: F64) -> Pose:
    """The pose after an increment about its root."""
    return moved(pose, steps.about_origin(pose.root[:3, 3], len(increment)) @ increment)


def errors(task: Task, pose: Pose) -> F64:
    joints, _ = kinematics.chain(task.body, pose)
    posed = kinematics.skin(task.body, joints, pose.angles)
    return normal_equations.point_errors(task.rows, posed[task.rows.vertex])[0]


def jacobian(task: Task, pose: Pose) -> tuple[F64, F64]:
    """Errors and dense Jacobian (R, 6 + D) about the root, in plain numpy."""
    body, rows, centre = task.body, task.rows, pose.root[:3, 3]
    joints, screws = kinematics.chain(body, pose)
    influence, weight = body.skin_joint[rows.vertex], body.skin_weight[rows.vertex]  # (R, 5)
    rest = np.column_stack([body.vertices[rows.vertex], np.ones(len(rows.vertex))])
    carried = np.einsum("rkab,rb->rka", joints[influence][..., :3, :], rest)
    error, gradient = normal_equations.point_errors(rows, np.einsum("rk,rka->ra", weight, carried))
    slope = np.broadcast_to(gradient[:, None], carried.shape)
    wrench = weight[..., None] * np.concatenate([np.cross(carried - centre, slope), slope], axis=2)
    about = screws.copy()
    about[:, 3:] += np.cross(screws[:, :3], centre)
    moves = kinematics.descendants(body.parents)[body.screw_joint].T[influence]  # (R, 5, D)
    angles = np.einsum("rki,di,rkd->rd", wrench, about, moves, optimize=True)
    return error, np.concatenate([wrench.sum(axis=1), angles], axis=1)


def ours(task: Task) -> Callable[[Pose], F64]:
    """One step as the solver takes it: normal equations, damping, solution."""
    lever = steps.levers(ANGLES, np.empty(0))

    def step(pose: Pose) -> F64:
        return steps.step(normal_equations.body_equations(task.rows, task.body, pose), lever, 1e-9)

    return step


def with_numpy(task: Task) -> Callable[[Pose], F64]:
    def step(pose: Pose) -> F64:
        error, dense = jacobian(task, pose)
        return -np.linalg.solve(dense.T @ dense, dense.T @ error)

    return step


def descend(step: Callable[[Pose], F64], start: Pose, count: int = 12) -> Pose:
    for _ in range(count):
        start = apply(start, step(start))
    return start


def with_scipy(task: Task, analytic: bool) -> tuple[Pose, float]:
    """The answer of scipy's trust region, and CPU ms for each of its iterations."""

    def at(x: F64) -> Pose:  # turn and shift about the start's root
        turn, shift = twists.exp(np.concatenate([x[:3], np.zeros(3)])), x[3:6]
        root = task.start.root.copy()
        root[:3, :3], root[:3, 3] = turn[:3, :3] @ root[:3, :3], root[:3, 3] + shift
        return Pose(root=root, angles=task.start.angles + x[6:])

    def derivative(x: F64) -> F64:
        dense = jacobian(task, at(x))[1]
        angle, w = np.linalg.norm(x[:3]), twists.hat(x[:3])
        if angle > 0:  # a change of the rotation vector as a turn in the world
            turn = np.eye(3) + (1 - np.cos(angle)) / angle**2 * w + (angle - np.sin(angle)) / angle**3 * w @ w
            dense[:, :3] = dense[:, :3] @ turn
        return dense

    begin = time.process_time()
    answer = least_squares(
        lambda x: errors(task, at(x)), np.zeros(6 + ANGLES), derivative if analytic else "2-point",
        xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return at(answer.x), (time.process_time() - begin) * 1e3 / answer.njev


def cpu_ms(action: Callable[[], object], times: int) -> float:
    samples = []
    for _ in range(7):
        begin = time.process_time()
        for _ in range(times):
            action()
        samples.append((time.process_time() - begin) / times * 1e3)
    return float(np.median(samples))


def compare(rigid: bool) -> None:
    task = make_task(rigid)
    joints = (task.body.skin_weight[task.rows.vertex] > 0).sum(axis=1).mean()
    print(f"\n{ROWS} residuals, {ANGLES} angles and the root, {joints:.2f} joints a vertex")
    best = descend(ours(task), task.start)
    results = [("scipy least_squares, numeric Jacobian", *with_scipy(task, False))]
    results.append(("scipy least_squares, analytic Jacobian", *with_scipy(task, True)))
    for name, step, times in (("numpy normal equations", with_numpy(task), 5), ("twist_gauss_newton", ours(task), 300)):
        results.append((name, descend(step, task.start), cpu_ms(lambda step=step: step(task.start), times)))
    slowest = results[0][2]
    print(f"{'':42}{'CPU ms':>10}{'ratio':>10}{'apart, rad':>12}")
    for name, pose, ms in results:
        apart = np.abs(pose.angles - best.angles).max()
        print(f"{name:42}{ms:10.3f}{ms / slowest:10.5f}{apart:12.1e}")
    equations = normal_equations.body_equations(task.rows, task.body, task.start)
    lever = steps.levers(ANGLES, np.empty(0))
    few = task.rows.part(np.arange(ROWS) < 1, task.rows.weight)
    parts: dict[str, Callable[[], object]] = {
        "of which normal equations": lambda: normal_equations.body_equations(task.rows, task.body, task.start),
        "  of them with one row": lambda: normal_equations.body_equations(few, task.body, task.start),
        "of which solution": lambda: steps.step(equations, lever, 1e-4),
        "energy at fixed matches": lambda: normal_equations.body_energy(task.rows, task.body, task.start),
    }
    for name, part in parts.items():
        print(f"{name:42}{cpu_ms(part, 300):10.3f}")


def main() -> None:
    task = make_task(rigid=False)
    begin = time.process_time()
    ours(task)(task.start)
    print(f"first step (compiles, or loads what was compiled): {time.process_time() - begin:.2f} s")
    for rigid in (False, True):
        compare(rigid)


if __name__ == "__main__":
    main()
