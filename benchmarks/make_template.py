"""Packs two subjects with one mesh into the template body.

`python benchmarks/make_template.py A B`; each is the folder `subject` of a recording.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mocapflow_bodies.template import FILE, UNIT
from mocapflow_bodies.weights import strongest

from mocapflow.geometry.skeleton import Skeleton, body_directions
from mocapflow.io.meshes import read_mesh
from mocapflow.io.scans import read_skeleton
from mocapflow.io.weights import read_weights
from mocapflow.records import F64

# MakeHuman's hips lie behind and outside the femoral heads (Bell 1989: from the front spines of the pelvis inward by
# 14 % of their distance, back by 22 %, down by 30 %), its knees above the epicondyles (thighs are as long as shanks).
MOVED_M = {"hip": (-0.026, 0.04, 0.0), "knee": (0.0, 0.0, -0.016)}  # m, outward, forward, up


def joint_centres(skeleton: Skeleton) -> F64:
    """Return the joint positions (J, 3) m with hips and knees where people have their centres of rotation."""
    forward, left, up = body_directions(skeleton)
    positions = skeleton.positions.copy()
    for joint, name in enumerate(skeleton.names):
        base, _, side = name.rpartition("_")
        outward = left if side == "l" else -left
        positions[joint] += np.array(MOVED_M.get(base, (0.0, 0.0, 0.0))) @ np.stack([outward, forward, up])
    return positions


def pack(first: Path, second: Path, out: Path) -> None:
    """Write both shapes with their common faces, joints and weights, lengths in tenths of a millimetre."""
    meshes = [read_mesh(folder / "body.obj") for folder in (first, second)]
    skeletons = [read_skeleton(folder / "skeleton.json") for folder in (first, second)]
    if not np.array_equal(meshes[0][1], meshes[1][1]) or skeletons[0].names != skeletons[1].names:
        raise SystemExit("the subjects differ in faces or joints")
    weights = [
        read_weights(folder / "weights.npz", skeleton, mesh[0])
        for folder, skeleton, mesh in zip((first, second), skeletons, meshes, strict=True)
    ]
    skin_joint, skin_weight = strongest((weights[0] + weights[1]) / 2)
    np.savez_compressed(
        out,
        vertices=np.stack([np.round(vertices / UNIT) for vertices, _ in meshes]).astype(np.int16),
        positions=np.stack([np.round(joint_centres(skeleton) / UNIT) for skeleton in skeletons]).astype(np.int16),
        faces=meshes[0][1].astype(np.uint16),
        names=np.array(skeletons[0].names),
        parents=skeletons[0].parents.astype(np.int8),
        skin_joint=skin_joint.astype(np.uint8),
        skin_weight=np.round(skin_weight * 65535).astype(np.uint16),
    )


if __name__ == "__main__":
    pack(Path(sys.argv[1]), Path(sys.argv[2]), FILE)
