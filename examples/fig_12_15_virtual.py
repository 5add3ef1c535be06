"""Legs with and without cloth in the virtual room: what the fit to the first frame of the demo clip has found.

Run `python examples/fig_12_15_virtual.py [PICTURE.png]`.
"""

from __future__ import annotations

from figures import first_frame, write
from mocapflow_report.room import Room

from mocapflow.data import NO_CLOTH, PoseBatch

SIZE = (640, 480)


def main() -> None:
    """Write the panels."""
    model, _, state = first_frame()
    pose, scene = state.estimate.pose, model.scene
    poses = PoseBatch(root=pose.root[None], angles=pose.angles[None])
    room, body = Room(scene, poses, SIZE), scene.bare(scene.surface(pose, state.cloth))
    write({"with cloth": room.picture(body, state.cloth.vertices), "without": room.picture(body, NO_CLOTH.vertices)})


if __name__ == "__main__":
    main()
