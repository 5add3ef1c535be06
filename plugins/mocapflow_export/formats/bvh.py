"""BVH: the skeleton with a rotation per joint and frame, for animation programs; cm, y up."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mocapflow.assets import Body
from mocapflow.records import F64
from mocapflow_export.formats.result import Result

CM = 100.0
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # from the z-up world
CHANNELS = "CHANNELS {} {}Zrotation Xrotation Yrotation"
TIP = 0.05  # m, length drawn beyond the last joint of a limb


def write(result: Result, path: Path) -> None:
    """Write skeleton and motion; at rest no joint is turned, so the rest pose is that of the body."""
    body, order = result.scene.body, depth_first(result.scene.body)
    lines = ["HIERARCHY", *hierarchy(body, order[0], 0), "MOTION"]
    lines += [f"Frames: {len(result.track.frame)}", f"Frame Time: {1 / result.recording.run_rate:.8f}"]
    turns = Y_UP @ result.turns @ Y_UP.T
    angles = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_euler("ZXY", degrees=True)
    angles = angles.reshape(*turns.shape[:2], 3)[:, order].reshape(len(turns), -1)
    angles = np.unwrap(angles, axis=0, period=360)  # what is drawn between frames does not spin round
    place = CM * result.places[:, order[0]] @ Y_UP.T
    lines += [" ".join(f"{x:.6f}" for x in row) for row in np.hstack([place, angles])]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def depth_first(body: Body) -> list[int]:
    """Return the joints in the order in which BVH nests them."""
    order: list[int] = []
    waiting = [int(np.flatnonzero(body.parents < 0)[0])]
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += [int(child) for child in np.flatnonzero(body.parents == joint)[::-1]]
    return order


def hierarchy(body: Body, joint: int, depth: int) -> Iterator[str]:
    """Yield the lines of a joint and all below it."""
    indent, parent = "  " * depth, int(body.parents[joint])
    offset = np.zeros(3) if parent < 0 else body.positions[joint] - body.positions[parent]
    channels = CHANNELS.format(*((6, "Xposition Yposition Zposition ") if parent < 0 else (3, "")))
    yield f"{indent}{'ROOT' if parent < 0 else 'JOINT'} {body.joint_names[joint]}"
    yield f"{indent}{{"
    yield f"{indent}  {placed(offset)}"
    yield f"{indent}  {channels}"
    children = np.flatnonzero(body.parents == joint)
    for child in children:
        yield from hierarchy(body, int(child), depth + 1)
    if not len(children):
        length = float(np.linalg.norm(offset)) or 1.0
        yield from (f"{indent}  {line}" for line in ("End Site", "{", "  " + placed(TIP * offset / length), "}"))
    yield f"{indent}}}"


def placed(offset: F64) -> str:
    """Return an offset in m as BVH writes it."""
    return "OFFSET " + " ".join(f"{x:.6f}" for x in CM * Y_UP @ offset)
