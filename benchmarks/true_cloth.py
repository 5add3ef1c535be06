"""How far is the draped garment from the true one? Mean distances of their surfaces in mm, at the true pose.

`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/true_cloth.py RECORDING [FRAMES [EVERY]]`, for a recording
with truth/joints.npz and truth/cloth.npz: every EVERY-th (default 8) of its first FRAMES (default 48). The poses have
the true joint centres; only thickness, take-up and forces `as tracked` come from images, of a run over these frames.
Distances are from the vertices of one surface to the other; `hem` says by how much the mean of ours is above the true
one, and the root mean square of that over frames and sixteen sectors of azimuth.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from held_out_camera import tracked
from limits import true_poses
from mocapflow_draping.kinematic import Kinematic

from mocapflow.assets import GarmentMesh
from mocapflow.data import Past, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.geometry.sewing import TAKE_UP
from mocapflow.records import F64, I32

SECTORS = 16  # of azimuth, in which the lowest vertices are the hem


class Sheet(NamedTuple):
    """Cloth as vertices (W, 3) m and faces (G, 3)."""

    vertices: F64
    faces: I32


def main() -> None:
    folder = Path(sys.argv[1])
    frames, every = (int(word) for word in (*sys.argv[2:], *("48", "8")[len(sys.argv) - 2 :]))
    rows = range(0, frames, every)
    archive = np.load(folder / "truth" / "cloth.npz")
    states, model = tracked(folder, frames)
    poses = true_poses(folder, model.scene, rows)
    true = [Sheet(archive["vertices"][row].astype(float), archive["faces"].astype(np.int32)) for row in rows]
    found = np.array([states[row].cloth.parameters for row in rows])
    batch = PoseBatch(root=np.stack([pose.root for pose in poses]), angles=np.stack([pose.angles for pose in poses]))
    garment = model.scene.garment
    assert garment is not None
    print(f"{folder.name}, {len(rows)} frames: mm from ours to true / back; hem above the true one, its RMS")
    for label, draper, parameters in drapes(garment, found):
        ours = draper.drape(batch, parameters, Past(), model.scene)
        apart = [distances(Sheet(shape, garment.faces), sheet) for shape, sheet in zip(ours, true, strict=True)]
        over = np.array([hem(shape) - hem(sheet.vertices) for shape, sheet in zip(ours, true, strict=True)])
        there, back = 1e3 * np.mean(apart, axis=0)
        print(
            f"  {label:32}{there:6.1f} / {back:4.1f}  {1e3 * over.mean():+6.1f} {1e3 * np.sqrt(np.mean(over**2)):6.1f}",
            flush=True,
        )


def drapes(garment: GarmentMesh, found: F64) -> Iterator[tuple[str, Draper, F64]]:
    """Return what is compared: a name, a draper, and parameters (T, Q) of each frame."""
    calm = np.zeros_like(found)
    shortened = calm.copy()
    if TAKE_UP in garment.parameter_names:
        column = garment.parameter_names.index(TAKE_UP)
        shortened[:, column] = found[:, column]
    yield "rings, as sewn", Kinematic(), calm
    yield "rings, take-up as tracked", Kinematic(), shortened
    yield "rings, all as tracked", Kinematic(), found
    yield "strands alone, as sewn", Kinematic(sweeps=0), calm
    yield "literal rule, as sewn", Kinematic(rule="literal", sweeps=0), calm
    if find_spec("newton"):  # the extra `physics`
        from mocapflow_physics.xpbd import Xpbd

        yield "newton XPBD, as sewn", Xpbd(), calm
        yield "newton XPBD, take-up as tracked", Xpbd(), shortened


def distances(ours: Sheet, true: Sheet) -> tuple[float, float]:
    """Return the mean distance in m of our vertices to the true surface, and of its vertices to ours."""
    return float(_to(true, ours.vertices).mean()), float(_to(ours, true.vertices).mean())


def _to(sheet: Sheet, points: F64) -> F64:
    """Return the distances (N,) m of points (N, 3) to the nearest points of a surface."""
    import open3d as o3d

    near = o3d.t.geometry.RaycastingScene()
    near.add_triangles(np.ascontiguousarray(sheet.vertices, np.float32), np.ascontiguousarray(sheet.faces, np.uint32))
    return np.asarray(near.compute_distance(points.astype(np.float32)).numpy(), float)


def hem(vertices: F64) -> F64:
    """Return the height (SECTORS,) m of the lowest vertex in each sector of azimuth about the garment's middle."""
    off = vertices[:, :2] - vertices[:, :2].mean(axis=0)
    sector = ((np.arctan2(off[:, 1], off[:, 0]) / (2 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    return np.array([vertices[sector == k, 2].min() for k in range(SECTORS)])


if __name__ == "__main__":
    main()
