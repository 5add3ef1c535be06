"""A small random person in front of four cameras, and exact matches of it."""

from __future__ import annotations

import numpy as np

from mocapflow.assets import Body, Camera
from mocapflow.data import NO_CLOTH, Estimate, FrameState, Matches, Pose, Segmentation, empty_matches
from mocapflow.geometry import cameras as pinhole
from mocapflow.geometry import kinematics, twists
from mocapflow.scene import Scene

PARENTS = np.array([-1, 0, 1, 2, 0, 4, 0, 6], np.int32)
SCREWS = np.array([1, 1, 1, 2, 3, 4, 4, 4, 5, 6, 6, 7], np.int32)


def make_body(seed: int = 0, vertices: int = 300) -> Body:
    """A pelvis with two legs and a trunk; every vertex hangs on one to five joints."""
    rng = np.random.default_rng(seed)
    joints, screws = len(PARENTS), len(SCREWS)
    positions = rng.normal(size=(joints, 3)) * 0.1
    for joint in range(1, joints):
        positions[joint] += positions[PARENTS[joint]] + [0, 0, 0.3 if joint >= 6 else -0.3]
    weight = np.sort(rng.random((vertices, 5)) ** 3 + 0.02, axis=1)[:, ::-1]
    weight[np.arange(5) >= rng.integers(1, 6, vertices)[:, None]] = 0.0
    skin = np.argsort(rng.random((vertices, joints)), axis=1)[:, :5].astype(np.int32)
    axes = np.eye(3)[[0, 1, 2, 0, 0, 0, 1, 2, 0, 0, 1, 0]] + 0.2 * rng.normal(size=(screws, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return Body(
        vertices=positions[skin[:, 0]] + rng.normal(size=(vertices, 3)) * 0.1,
        faces=np.array([[0, 1, 2]], np.int32),
        joint_names=tuple(f"joint{index}" for index in range(joints)),
        parents=PARENTS.copy(),
        positions=positions,
        screw_names=tuple(f"screw{index}" for index in range(screws)),
        twists=twists.screw(axes, positions[SCREWS]),
        screw_joint=SCREWS.copy(),
        limits=np.tile([-1.0, 1.5], (screws, 1)),
        rest_spread=np.where(np.arange(screws) % 3, np.inf, 0.07),
        skin_joint=skin,
        skin_weight=weight / weight.sum(axis=1, keepdims=True),
        cut=np.zeros(vertices, bool),
    )


def make_cameras(count: int = 4) -> tuple[Camera, ...]:
    """Cameras on a circle of 3 m about (1, 2, 1), looking at it."""
    return tuple(_camera(index, 2 * np.pi * index / count) for index in range(count))


def _camera(index: int, azimuth: float) -> Camera:
    target = np.array([1.0, 2.0, 1.0])
    forward = -np.array([np.cos(azimuth), np.sin(azimuth), 0.1])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3], camera_from_world[:3, 3] = rotation, -rotation @ (target - 3 * forward)
    return Camera(
        name=f"cam{index}",
        size=np.array([640, 800], np.int32),
        intrinsics=np.array([[700.0, 0, 320], [0, 710.0, 400], [0, 0, 1]]),
        distortion=np.zeros(5),
        camera_from_world=camera_from_world,
    )


def make_scene(seed: int = 0) -> Scene:
    return Scene(cameras=make_cameras(), body=make_body(seed))


def make_pose(seed: int, angle: float = 0.3) -> Pose:
    """A random pose about (1, 2, 1)."""
    rng = np.random.default_rng(seed)
    root = twists.exp(np.concatenate([rng.normal(size=3) * angle, np.zeros(3)]))
    root[:3, 3] = np.array([1.0, 2.0, 1.0]) + rng.normal(size=3) * 0.05
    return Pose(root=root, angles=rng.normal(size=len(SCREWS)) * angle)


def exact_matches(scene: Scene, pose: Pose, vertices: np.ndarray, directed: bool, seed: int = 0) -> Matches:
    """Where the vertices of a posed body are seen, in every view; with random directions, or with none."""
    rng = np.random.default_rng(seed)
    points = kinematics.skin(scene.body, kinematics.chain(scene.body, pose)[0], pose.angles)[vertices]
    count = len(scene.cameras) * len(vertices)
    angle = rng.uniform(0, 2 * np.pi, count)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1) if directed else np.zeros((count, 2))
    return Matches(
        camera=np.repeat(np.arange(len(scene.cameras), dtype=np.int16), len(vertices)),
        pixel=np.concatenate([pinhole.project(points, camera) for camera in scene.cameras]),
        direction=direction,
        vertex=np.tile(vertices, len(scene.cameras)).astype(np.int32),
        weight=np.ones(count),
    )


def make_state(pose: Pose) -> FrameState:
    unknowns = 6 + len(pose.angles)
    estimate = Estimate(pose=pose, parameters=np.empty(0), covariance=np.eye(unknowns), observed=np.ones(unknowns - 6))
    return FrameState(
        estimate=estimate, cloth=NO_CLOTH, segmentation=Segmentation(silhouettes=()), matches=empty_matches()
    )
