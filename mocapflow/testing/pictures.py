"""Pictures of the tiny scene: an empty room, noisy frames, true silhouettes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import Estimate, Frame, FrameState, Pose, Segmentation, Silhouette, Surface, empty_matches
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import mask_distance
from mocapflow.records import F32, U8, Bool
from mocapflow.scene import Scene
from mocapflow.testing.scenes import tiny_cloth
from mocapflow.testing.views import SIZE, room

BAND = 8.0  # px


def tiny_frame(scene: Scene, pose: Pose, index: int = 5) -> Frame:
    """Return noisy pictures of the scene at a pose: a bright striped person in the grey room."""
    rng = np.random.default_rng(index)
    images = []
    for number, mask in enumerate(tiny_masks(scene, pose)):
        stripes = 200 + 30 * np.sin(np.arange(SIZE[1]) / 5)[:, None, None] * np.ones((1, SIZE[0], 3))
        clean = np.where(mask[..., None], stripes * [0.6, 0.8, 1.0], room(number))
        images.append(np.clip(clean + 4 * rng.normal(size=clean.shape), 0, 255).astype(np.uint8))
    return Frame(index=index, time=index / 30, images=tuple(images), usable=np.ones(len(images), bool))


def tiny_masks(scene: Scene, pose: Pose) -> list[Bool]:
    """Return the true silhouette (240, 320) in each view."""
    surface = scene.surface(pose, tiny_cloth(scene, pose))
    return [_mask(surface, camera) for camera in scene.cameras]


def tiny_segmentation(scene: Scene, pose: Pose) -> Segmentation:
    """Return the true silhouettes as signed distances."""
    return Segmentation(
        silhouettes=tuple(
            Silhouette(camera=camera, layer="person", distance=_distance(mask))
            for camera, mask in enumerate(tiny_masks(scene, pose))
        )
    )


def tiny_state(scene: Scene, pose: Pose, seen: Pose | None = None) -> FrameState:
    """Return what the loop knows when it believes in `pose` while the silhouettes show `seen`."""
    cloth = tiny_cloth(scene, pose)
    unknowns = 6 + len(pose.angles) + len(cloth.parameters)
    observed = np.ones(len(pose.angles))
    estimate = Estimate(pose=pose, parameters=cloth.parameters, covariance=1e-4 * np.eye(unknowns), observed=observed)
    return FrameState(
        estimate=estimate, cloth=cloth, segmentation=tiny_segmentation(scene, seen or pose), matches=empty_matches()
    )


def without_view(frame: Frame, camera: int) -> Frame:
    """Return a frame in which one view is lost."""
    usable = frame.usable.copy()
    usable[camera] = False
    images = tuple(np.zeros_like(image) if k == camera else image for k, image in enumerate(frame.images))
    return replace(frame, images=images, usable=usable)


def without_silhouette(segmentation: Segmentation, camera: int) -> Segmentation:
    """Return a segmentation without one view."""
    kept = tuple(silhouette for silhouette in segmentation.silhouettes if silhouette.camera != camera)
    return replace(segmentation, silhouettes=kept)


def _mask(surface: Surface, camera: Camera) -> Bool:
    import cv2

    corners = np.round(project(surface.vertices, camera)[surface.faces] * 16).astype(np.int32)
    mask: U8 = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    for corner in corners:
        cv2.fillConvexPoly(mask, corner, 1, cv2.LINE_8, 4)
    return mask > 0


def _distance(mask: Bool) -> F32:
    return np.clip(mask_distance(mask), -BAND, BAND)
