"""Figures 12.9 to 12.12: the steps of a skirt's fall, shorts, rings closed again, and wind from two sides.

    python examples/fig_12_09_cloth.py [OUT.png]

Draws the shipped demo clips' bodies and garments from the side; needs no display.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib
import numpy as np
from mocapflow_bodies.scanned import Scanned
from mocapflow_draping.kinematic import Kinematic
from mocapflow_garments.shorts import Shorts
from mocapflow_garments.skirt import Skirt

from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.geometry import kinematics
from mocapflow.scene import Scene

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.collections import PolyCollection

DATA = Path(__file__).parent / "data"
LIGHT = np.array([0.4, -0.8, 0.45])
AHEAD = np.array([0.8, 0.6])  # direction of view over the floor, from the front left


def clothed(clip: str) -> Scene:
    """Return the person of a demo clip in the garment of its tape measures."""
    body = Scanned().load(DATA / clip)
    tapes = json.loads((DATA / clip / "subject" / "garment.json").read_text())
    kind = {"skirt": Skirt, "shorts": Shorts}[tapes.pop("type")]
    return Scene(cameras=(), body=body, garment=kind(**{f"{key}_m": value for key, value in tapes.items()}).sew(body))


def raised(scene: Scene, hip: float, knee: float) -> Pose:
    """Return the rest pose with the left knee raised, degrees."""
    angles = np.zeros(len(scene.body.twists))
    names = scene.body.screw_names
    angles[names.index("hip_l.flexion")], angles[names.index("knee_l.flexion")] = np.radians([hip, knee])
    return Pose(root=np.eye(4), angles=angles)


def draw(axes: plt.Axes, scene: Scene, pose: Pose, draper: Kinematic, title: str, **forces: float) -> None:
    """Draw body and garment, shaded, the far faces first."""
    garment = scene.garment
    assert garment is not None
    parameters = np.array([[forces.get(name, 0.0) for name in garment.parameter_names]])
    poses = PoseBatch(root=pose.root[None].copy(), angles=pose.angles[None].copy())
    cloth = draper.drape(poses, parameters, Past(), scene)[0]
    skin = kinematics.skin(scene.body, kinematics.chain(scene.body, pose)[0])
    vertices, faces = np.concatenate([skin, cloth]), scene.faces
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    shade = 0.35 + 0.65 * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    colour = np.where(np.arange(len(faces))[:, None] < len(scene.body.faces), [0.85, 0.7, 0.6], [0.25, 0.4, 0.75])
    across = np.array([AHEAD[1], -AHEAD[0]])
    order = np.argsort(corners[:, :, :2].mean(axis=1) @ AHEAD)[::-1]
    flat = np.stack([-corners[..., :2] @ across, corners[..., 2]], axis=-1)[order]
    axes.add_collection(PolyCollection(flat, facecolors=(colour * shade[:, None])[order], edgecolors="none"))
    axes.set(xlim=(-0.5, 0.5), ylim=(0.0, 1.3), aspect="equal", title=title)
    axes.axis("off")


def main() -> None:
    """Write the picture."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("fig_12_09_cloth.png")
    skirt, shorts = clothed("skirt_steps"), clothed("shorts_steps")
    figure, panels = plt.subplots(3, 4, figsize=(14, 14))
    up = raised(skirt, 65, 70)
    for panel, iterations in zip(panels[0], (1, 15, 30, 50), strict=True):
        steps = Kinematic(rule="literal", limited=True, sweeps=0, iterations=iterations)
        draw(panel, skirt, up, steps, f"skirt after {iterations} steps")
    draw(panels[1, 0], skirt, up, Kinematic(sweeps=0), "strands alone")
    draw(panels[1, 1], skirt, up, Kinematic(sweeps=40), "rings closed")
    draw(panels[1, 2], shorts, raised(shorts, 0, 0), Kinematic(), "shorts")
    draw(panels[1, 3], shorts, raised(shorts, 65, 70), Kinematic(), "shorts, knee raised")
    standing, still = raised(skirt, 0, 0), raised(shorts, 0, 0)
    draw(panels[2, 0], skirt, standing, Kinematic(), "wind from the front", wind_sin_rad=0.35)
    draw(panels[2, 1], skirt, standing, Kinematic(), "wind from behind", wind_sin_rad=-0.35)
    draw(panels[2, 2], shorts, still, Kinematic(), "wind from the front", wind_sin_rad=0.35)
    draw(panels[2, 3], shorts, still, Kinematic(), "wind from behind", wind_sin_rad=-0.35)
    figure.tight_layout()
    figure.savefig(out, dpi=70)
    print(f"wrote {out}")


if __name__ == "__main__":
    main()
