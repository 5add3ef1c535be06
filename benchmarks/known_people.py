"""People of another build than the two who were scanned, for `known_motion.py`; nothing of the tracker takes part."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import open3d as o3d
from known_poses import Body

# how much of what is laid on lies where skin follows these joints; nothing on head, hands and feet
WHERE = {"pelvis": 1.0, "spine": 1.0, "chest": 0.6, "hip": 0.7, "knee": 0.3, "clavicle": 0.4, "shoulder": 0.5}


@dataclass(frozen=True)
class Build:
    """How somebody differs from who was scanned."""

    height_m: float
    laid_on_m: float = 0.0  # thickness at the belly; below 0: somebody slimmer
    legs: float = 1.0  # length of what is below the hips, beside somebody of that height


BUILDS = {
    "heavy": Build(height_m=1.57, laid_on_m=0.030, legs=0.98),
    "slim": Build(height_m=1.90, laid_on_m=-0.010, legs=1.02),
}


def built(body: Body, build: Build) -> Body:
    """Return a body of another build; its soles stay on the floor."""
    hips = body.joint("hip_l")[2]
    factor = build.height_m / (body.vertices[:, 2].max() + (build.legs - 1) * hips)

    def resized(points: np.ndarray) -> np.ndarray:
        below = np.minimum(points[:, 2], hips)
        return factor * (points + np.outer(below * (build.legs - 1), [0, 0, 1]))

    thick = build.laid_on_m * body.weights @ [WHERE.get(n.removesuffix("_l").removesuffix("_r"), 0) for n in body.names]
    vertices = resized(body.vertices) + thick[:, None] * normals(body)
    return replace(body, vertices=vertices, joints=resized(body.joints))


def normals(body: Body) -> np.ndarray:
    """Return the outward normals (V,3) of the skin."""
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(body.vertices), o3d.utility.Vector3iVector(body.faces.astype("i4"))
    )
    mesh.compute_vertex_normals()
    return np.asarray(mesh.vertex_normals)


def write_body(body: Body, owner: Path, to: Path) -> None:
    """Write body.obj and skeleton.json of a body, as those in the folder of who was scanned."""
    lines, places = (owner / "body.obj").read_text().splitlines(), iter(body.vertices.tolist())
    moved = [" ".join(["v", *(f"{x:.6f}" for x in next(places))]) if line[:2] == "v " else line for line in lines]
    (to / "body.obj").write_text("\n".join(moved) + "\n")
    skeleton, joints = json.loads((owner / "skeleton.json").read_text()), body.joints.round(6).tolist()
    for joint in skeleton["joints"]:
        joint["position"] = joints[body.names.index(joint["name"])]
    (to / "skeleton.json").write_text(json.dumps(skeleton, indent=1))
