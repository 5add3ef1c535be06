"""How the body comes to the pose it is draped in."""

from __future__ import annotations

import numpy as np

from mocapflow.data import Past, PoseBatch
from mocapflow.geometry import twists
from mocapflow.geometry.kinematics import root_position
from mocapflow.records import F64
from mocapflow.scene import Scene


def centred(scene: Scene, root: F64) -> tuple[F64, F64]:
    """Return transforms (B, 4, 4) with the root joint at zero, and where it was (B, 3): near zero f4 is finest."""
    centre = root_position(scene.body, root)
    near = root.copy()
    near[:, :3, 3] -= centre
    return near, centre


def beginning(past: Past, scene: Scene, local: PoseBatch) -> tuple[PoseBatch, F64]:
    """Return poses and cloth (B, W, 3) m to begin with: the last frame's, or the rest pose in the garment as sewn."""
    assert scene.garment is not None
    count = len(local.root)
    if past.moments:
        last = past.moments[-1]
        root, centre = centred(scene, last.pose.root[None])
        cloth = np.repeat((last.cloth.vertices - centre)[None], count, axis=0)
        angles = np.repeat(last.pose.angles[None], count, axis=0)
        return PoseBatch(root=np.repeat(root, count, axis=0), angles=angles), cloth
    sewn = np.einsum("bij,wj->bwi", local.root[:, :3, :3], scene.garment.vertices) + local.root[:, None, :3, 3]
    return PoseBatch(root=local.root.copy(), angles=np.zeros_like(local.angles)), sewn


def between(start: PoseBatch, end: PoseBatch, count: int) -> list[PoseBatch]:
    """Return `count` poses on the way from one to another, that one included."""
    turns = [twists.log(b @ twists.inverse(a)) for a, b in zip(start.root, end.root, strict=True)]
    poses = []
    for share in np.arange(1, count) / count:
        root = np.stack([twists.exp(share * turn) @ a for turn, a in zip(turns, start.root, strict=True)])
        poses.append(PoseBatch(root=root, angles=(1 - share) * start.angles + share * end.angles))
    return [*poses, end]
