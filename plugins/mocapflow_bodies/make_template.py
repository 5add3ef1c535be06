"""Packs two subjects with one mesh into the template: `python -m mocapflow_bodies.make_template A B`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from mocapflow.io.meshes import read_mesh
from mocapflow_bodies.skeleton import read_skeleton
from mocapflow_bodies.template import FILE, UNIT
from mocapflow_bodies.weights import read_weights, strongest


def pack(first: Path, second: Path, out: Path) -> None:
    """Write both shapes with their common faces, joints and weights, lengths in tenths of a millimetre."""
    meshes = [read_mesh(folder / "body.obj") for folder in (first, second)]
    skeletons = [read_skeleton(folder / "skeleton.json") for folder in (first, second)]
    if not np.array_equal(meshes[0][1], meshes[1][1]) or skeletons[0].names != skeletons[1].names:
        raise SystemExit("the subjects differ in faces or joints")
    weights = [
        read_weights(folder / "weights.npz", skeleton, len(mesh[0]))
        for folder, skeleton, mesh in zip((first, second), skeletons, meshes, strict=True)
    ]
    skin_joint, skin_weight = strongest((weights[0] + weights[1]) / 2)
    np.savez_compressed(
        out,
        vertices=np.stack([np.round(vertices / UNIT) for vertices, _ in meshes]).astype(np.int16),
        positions=np.stack([np.round(skeleton.positions / UNIT) for skeleton in skeletons]).astype(np.int16),
        faces=meshes[0][1].astype(np.uint16),
        names=np.array(skeletons[0].names),
        parents=skeletons[0].parents.astype(np.int8),
        skin_joint=skin_joint.astype(np.uint8),
        skin_weight=np.round(skin_weight * 65535).astype(np.uint16),
    )


if __name__ == "__main__":
    pack(Path(sys.argv[1]), Path(sys.argv[2]), FILE)
