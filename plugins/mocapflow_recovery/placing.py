"""Where a person stands by their silhouettes, and poses put there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mocapflow_fitting.triangulate import triangulate

from mocapflow.assets import Camera
from mocapflow.data import NO_CLOTH, Frame, Pose
from mocapflow.geometry.silhouettes import covered
from mocapflow.records import F64, Bool
from mocapflow.scene import Scene
from mocapflow_recovery.trimaps import SmallRoom, changes


def placed(bare: Scene, turn: float, angles: F64, middle: F64) -> Pose:
    """Return a pose turned (rad) about the vertical, the box around the body in the middle (3) m."""
    root = np.eye(4)
    root[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    vertices = bare.surface(Pose(root=root.copy(), angles=angles), NO_CLOTH).vertices
    root[:3, 3] = middle - (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    return Pose(root=root, angles=angles)


def centred(pose: Pose, bare: Scene, middle: F64, cameras: Sequence[Camera]) -> Pose:
    """Return a pose moved so that the rays through the middles of its silhouettes meet in the middle (3) m.

    One that fewer than two cameras see stays.
    """
    surface, root = bare.surface(pose, NO_CLOTH), pose.root.copy()
    root[:3, 3] += np.nan_to_num(middle - mask_centre([covered(surface, camera) for camera in cameras], cameras))
    return Pose(root=root, angles=pose.angles)


def mask_centre(masks: Sequence[Bool], cameras: Sequence[Camera]) -> F64:
    """Return where (3) m the rays through the middles of masks (h, w) meet best; NaN where fewer than two show any."""
    if len(masks) < 2:
        return np.full(3, np.nan)
    middles = [np.argwhere(mask).mean(axis=0)[::-1] if mask.any() else np.full(2, np.nan) for mask in masks]
    position: F64 = triangulate(np.array(middles)[:, None], np.ones((len(masks), 1)), cameras).position[0]
    return position


def largest_changes(frame: Frame, rooms: Sequence[SmallRoom]) -> tuple[list[Bool], list[Camera]]:
    """Return the largest part (h, w) of each usable view that differs from the room, and the views' cameras."""
    import cv2

    masks, cameras = [], []
    for number in np.flatnonzero(frame.usable).tolist():
        changed = changes(frame.images[number], frame.hidden_in(number), rooms[number])
        opened = cv2.morphologyEx(changed.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        _, label, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
        stats[0, cv2.CC_STAT_AREA] = 0
        masks.append((label == stats[:, cv2.CC_STAT_AREA].argmax()) & (opened > 0))
        cameras.append(rooms[number].camera)
    return masks, cameras


def heading_between(one: Pose, other: Pose) -> float:
    """Return the angle (rad) between the directions in which two poses look."""
    forward = one.root[:2, 1], other.root[:2, 1]
    return float(np.arccos(np.clip(np.dot(*forward) / np.prod(np.linalg.norm(forward, axis=1)), -1, 1)))
