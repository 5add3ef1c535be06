"""Figure 12.8: a square of cloth falls on a table, step by step of 2 degrees, by the chapter's literal rule.

Run `python examples/fig_12_08_plane.py [PICTURE.png]`. The cloth is pinned nowhere: it sinks until it touches, then
what lies beyond the edge turns about the nearest particle that lies on the table.
"""

from __future__ import annotations

import numpy as np
from figures import write
from mocapflow_draping.fields import build_fields
from mocapflow_draping.literal import settle_in_steps
from mocapflow_draping.parts import posed_parts
from mocapflow_report.portrait import portrait

from mocapflow import Body, GarmentMesh, Pose, Scene
from mocapflow.geometry import sewing
from mocapflow.records import F64

STEPS = (0, 12, 25, 50)
CLOTH, TABLE, HEIGHT = 0.9, 0.5, 1.1  # m
COUNT = 46  # particles along an edge
SKIN = 0.005  # m


def table() -> Body:
    """Return a block that stands on the floor, as a body of one joint."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)]) * [TABLE, TABLE, HEIGHT]
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[side[0], side[k], side[k + 1]] for side in sides for k in (1, 2)], np.int32)
    return Body(
        vertices=corners, faces=faces, joint_names=("table",), parents=np.array([-1], np.int32),
        positions=np.zeros((1, 3)), screw_names=(), twists=np.empty((0, 6)), screw_joint=np.empty(0, np.int32),
        limits=np.empty((0, 2)), rest_spread=np.empty(0), skin_joint=np.zeros((8, 5), np.int32),
        skin_weight=np.tile([1.0, 0, 0, 0, 0], (8, 1)), cut=np.zeros(8, bool),
    )  # fmt: skip


def cloth(body: Body) -> GarmentMesh:
    """Return a level square of cloth above the table."""
    line = np.linspace(-CLOTH / 2, CLOTH / 2, COUNT)
    rows = np.stack([*np.meshgrid(line, line, indexing="ij"), np.full((COUNT, COUNT), HEIGHT + 0.05)], axis=-1)
    return sewing.sheet("cloth", body, rows, closed=False)


def fallen(body: Body, sheet: GarmentMesh, steps: int) -> F64:
    """Return the cloth's vertices (W, 3) m after it has touched the table and then turned for some steps."""
    fields = build_fields(body, np.array([0], np.int32), 0.01)
    parts = posed_parts(fields, np.eye(4)[None, None])
    grid = sheet.vertices[sheet.strands][None].copy()
    first, last = np.zeros(COUNT, np.int32), np.full(COUNT, COUNT - 1, np.int32)
    fixed, skin = np.zeros(grid.shape[:3], bool), np.array([SKIN])
    settle_in_steps(grid, fixed, first, last, skin, np.radians(2), steps, True, True, parts, fields.values)
    vertices: F64 = grid.reshape(-1, 3)
    return vertices


def main() -> None:
    """Write the panels."""
    body = table()
    scene = Scene(cameras=(), body=body, garment=cloth(body))
    pose = Pose(root=np.eye(4), angles=np.empty(0))
    assert scene.garment is not None
    write(
        {
            f"after {steps} steps": portrait(
                scene, pose, fallen(body, scene.garment, steps), bearing_deg=25, size=(420, 420), above=0.35
            )
            for steps in STEPS
        }
    )


if __name__ == "__main__":
    main()
