"""The demo person with ball joints, and a track of it: no other plugin is needed."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np

from mocapflow.assets import Body, Camera, GarmentMesh
from mocapflow.data import Pose
from mocapflow.geometry import joints, twists
from mocapflow.geometry.sewing import grid_faces
from mocapflow.results import Track
from mocapflow.scene import Scene

DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


def ball_body(names: tuple[str, ...] = (), folder: Path = DEMO) -> Body:
    """Return the subject with three screws about x, y and z per joint; `names` keeps a part of the joints."""
    entries = json.loads((folder / "subject" / "skeleton.json").read_text())["joints"]
    kept = [e for e in entries if not names or e["name"] in names]
    order = [e["name"] for e in kept]
    positions = np.array([e["position"] for e in kept], np.float64)
    parents = np.array([order.index(e["parent"]) if e["parent"] else -1 for e in kept], np.int32)
    moving = np.repeat(np.arange(1, len(kept)), 3)
    count = len(moving)
    lines = (folder / "subject" / "body.obj").read_text().splitlines()
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], np.float64)
    faces = [[int(c.split("/")[0]) - 1 for c in line.split()[1:]] for line in lines if line.startswith("f ")]
    triangles = [(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)]
    weights = np.load(folder / "subject" / "weights.npz")
    full = np.zeros((len(vertices), len(kept)))
    parent_of = {e["name"]: e["parent"] for e in entries}
    for column, joint in enumerate(str(name) for name in weights["names"]):
        while joint not in order:
            joint = parent_of[joint]  # noqa: PLW2901  the skin of a joint that is left out follows its parent
        full[:, order.index(joint)] += weights["weights"][:, column]
    if len(kept) < 5:
        full = np.pad(full, ((0, 0), (0, 5 - len(kept))))
    skin = np.argsort(-full, axis=1)[:, :5]
    weight = np.take_along_axis(full, skin, 1)
    skin = np.minimum(skin, len(kept) - 1)  # what was padded weighs nothing
    return Body(
        vertices=vertices, faces=np.array(triangles, np.int32), joint_names=tuple(order), parents=parents,
        positions=positions, screw_names=tuple(f"{order[j]}.{'xyz'[k % 3]}" for k, j in enumerate(moving)),
        twists=twists.screw(np.tile(np.eye(3), (count // 3, 1)), positions[moving]),
        screw_joint=moving.astype(np.int32),
        limits=np.tile([-3.0, 3.0], (count, 1)), rest_spread=np.full(count, np.inf),
        skin_joint=skin.astype(np.int32), skin_weight=weight / weight.sum(1, keepdims=True),
        cut=np.zeros(len(vertices), bool),
    )  # fmt: skip


def start_pose(body: Body, folder: Path = DEMO) -> Pose:
    """Return the pose of `init.json`."""
    init = json.loads((folder / "init.json").read_text())
    rotation = twists.exp(np.append(init["root_rotation"], np.zeros(3)))[:3, :3]
    root = np.eye(4)
    root[:3, :3] = rotation
    root[:3, 3] = np.array(init["root_translation"]) - rotation @ body.positions[0]
    known = {n: np.array(v) for n, v in init["joint_rotations"].items() if n in body.joint_names}
    return Pose(root=root, angles=joints.angles_from_rotations(body, known))


def cameras(folder: Path = DEMO) -> tuple[Camera, ...]:
    """Return the cameras of the demo."""
    tables = tomllib.loads((folder / "cameras.toml").read_text())
    made = []
    for table in (t for name, t in tables.items() if name.startswith("cam")):
        pose = np.eye(4)
        pose[:3, :3] = twists.exp(np.append(table["rotation"], np.zeros(3)))[:3, :3]
        pose[:3, 3] = table["translation"]
        made.append(
            Camera(
                name=table["name"],
                size=np.array(table["size"], np.int32),
                intrinsics=np.array(table["matrix"]),
                distortion=np.zeros(5),
                camera_from_world=pose,
            )  # fmt: skip
        )
    return tuple(made)


def tube(body: Body, rows: int = 12, columns: int = 36) -> GarmentMesh:
    """Return a plain skirt-like tube around the hips."""
    height = np.linspace(1.0, 0.45, rows)
    around = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    radius = np.linspace(0.17, 0.28, rows)
    points = np.stack(
        [radius[:, None] * np.cos(around), radius[:, None] * np.sin(around), np.repeat(height[:, None], columns, 1)], -1
    ).reshape(-1, 3)
    grid = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    rings = np.stack([grid.ravel(), np.roll(grid, -1, axis=1).ravel()], 1).astype(np.int32)
    return GarmentMesh(
        name="tube", vertices=points, faces=grid_faces(grid.T),
        strands=np.ascontiguousarray(grid.T), rings=rings, ring_length=np.full(len(rings), 0.05),
        carried_by=np.zeros(len(points), np.int32), pinned=grid[0].copy(), pinned_to=np.zeros(columns, np.int32),
        parameter_names=(), parameter_bounds=np.empty((0, 2)),
    )  # fmt: skip


def demo_scene(clothed: bool = False) -> Scene:
    """Return cameras and person of the demo."""
    body = ball_body()
    return Scene(cameras=cameras(), body=body, garment=tube(body) if clothed else None)


def make_track(
    root: np.ndarray, angles: np.ndarray, sd: float = 0.01, views: int = 4, cloth: int = 0, fps: float = 30.0
) -> Track:
    """Return a track of poses (T, 4, 4) and (T, D) with one standard deviation for everything."""
    count, size = len(root), 6 + angles.shape[1]
    return Track(
        frame=np.arange(count, dtype=np.int32), time=np.arange(count) / fps, root=root, angles=angles,
        covariance=np.tile(sd**2 * np.eye(size), (count, 1, 1)), observed=np.ones(angles.shape),
        cloth=np.zeros((count, cloth, 3)), cloth_parameters=np.zeros((count, 0)),
        iterations=np.full(count, 3, np.int16), steady=np.ones(count, bool), oscillating=np.zeros(count, bool),
        doubted=np.zeros(count, bool), usable=np.ones((count, views), bool), overlap=np.full((count, views), 0.9),
        seconds=np.full((count, 2), 0.01), step_names=("segment", "solve"),
        energy=np.tile([[1.0, 2.0], [0.5, 2.0], [np.nan, np.nan]], (count, 1, 1)),
        energy_terms=("cam01.data", "rest_pose"),
    )  # fmt: skip


def stepping(body: Body, count: int = 40) -> Track:
    """Return the start pose of the demo with both knees swinging."""
    pose = start_pose(body)
    angles = np.tile(pose.angles, (count, 1))
    phase = np.linspace(0, 4 * np.pi, count)
    for side, sign in (("l", 1), ("r", -1)):
        lift = 0.3 * (1 + sign * np.sin(phase))
        if f"hip_{side}.x" in body.screw_names:
            angles[:, body.screw_names.index(f"hip_{side}.x")] -= lift
            angles[:, body.screw_names.index(f"knee_{side}.x")] += 1.5 * lift
    return make_track(np.tile(pose.root, (count, 1, 1)), angles)
