"""A small scene made by formula: a body of tubes, a hanging tube of cloth, cameras around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocapflow.assets import Background
from mocapflow.data import NO_CLOTH, Cloth, Matches, Moment, Past, Pose, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.geometry import twists
from mocapflow.geometry.cameras import project
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing.bodies import tiny_body, tiny_garment
from mocapflow.testing.views import room, tiny_camera


def tiny_scene(cameras: int = 4, clothed: bool = False) -> Scene:
    """Return the tiny body, dressed or not, in an empty room of even grey seen by pinhole cameras of 320 x 240 px."""
    body = tiny_body()
    empty = [room(camera).astype(np.float32) for camera in range(cameras)]
    return Scene(
        cameras=tuple(tiny_camera(index, 2 * np.pi * (index + 0.3) / cameras) for index in range(cameras)),
        body=body,
        garment=tiny_garment(body) if clothed else None,
        background=Background(mean=tuple(empty), spread=tuple(np.full_like(mean, 4.0) for mean in empty)),
    )


def tiny_pose(scene: Scene, seed: int = 0, size: float = 0.15) -> Pose:
    """Return a pose of the tiny body near rest: root and angles off by about `size` rad, the root by a third in m."""
    rng = np.random.default_rng(seed)
    root = twists.exp(np.concatenate([size * rng.normal(size=3), np.zeros(3)]))
    pelvis = scene.body.positions[0]
    root[:3, 3] = pelvis - root[:3, :3] @ pelvis + size / 3 * rng.normal(size=3)
    return Pose(root=root, angles=size * rng.normal(size=len(scene.body.limits)))


class Rigid(Draper):
    """A draper for tests: the garment moves with the root, its parameters push it sideways."""

    name = "rigid"

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return the rest garment at each root, leaning with the second and third parameter."""
        assert scene.garment is not None
        rest = scene.garment.vertices
        sideways = np.pad(parameters[:, None, 1:3], ((0, 0), (0, 0), (0, 1)))
        lean = (rest[:, 2].max() - rest[:, 2])[None, :, None] * sideways
        moved: F64 = (rest + lean) @ np.swapaxes(poses.root[:, :3, :3], 1, 2) + poses.root[:, None, :3, 3]
        return moved


def tiny_model(scene: Scene) -> ClothedModel:
    """Return the scene with a draper that needs no plugin."""
    return ClothedModel(scene=scene, draper=Rigid() if scene.garment is not None else None)


def tiny_cloth(scene: Scene, pose: Pose) -> Cloth:
    """Return the cloth of the tiny scene at a pose, at rest."""
    return tiny_model(scene).drape(pose, scene.neutral_parameters, Past())


def tiny_past(scene: Scene, *poses: Pose) -> Past:
    """Return a past of poses at 30 a second, the last one at frame 4."""
    first = 5 - len(poses)
    return Past(
        moments=tuple(
            Moment(time=(first + k) / 30, pose=pose, cloth=tiny_cloth(scene, pose)) for k, pose in enumerate(poses)
        )
    )


def exact_matches(scene: Scene, seen: Pose) -> Matches:
    """Return every third body vertex of the true pose paired with its picture in every view."""
    surface = scene.surface(seen, NO_CLOTH)
    vertex = np.arange(0, len(scene.body.vertices), 3, dtype=np.int32)
    pixels = [project(surface.vertices[vertex], camera) for camera in scene.cameras]
    count = len(vertex) * len(scene.cameras)
    return Matches(
        camera=np.repeat(np.arange(len(scene.cameras), dtype=np.int16), len(vertex)),
        pixel=np.concatenate(pixels),
        direction=np.zeros((count, 2)),
        vertex=np.tile(vertex, len(scene.cameras)),
        weight=np.ones(count),
    )


def rebased(scene: Scene, pose: Pose, shift: F64) -> tuple[Scene, Pose]:
    """Return the same person in the same place whose rest lies `shift` (3,) m elsewhere, bare."""
    body = scene.body
    twisted = body.twists.copy()
    twisted[:, 3:] -= np.cross(twisted[:, :3], shift)
    moved = replace(body, vertices=body.vertices + shift, positions=body.positions + shift, twists=twisted)
    root = pose.root.copy()
    root[:3, 3] -= root[:3, :3] @ shift
    return replace(scene, body=moved, garment=None), Pose(root=root, angles=pose.angles)
