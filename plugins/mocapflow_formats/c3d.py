"""C3D: joint centres as markers, for biomechanics programs; mm, axes of the world."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow_formats.result import Result, library


def write(result: Result, path: Path) -> None:
    """Write the joint centres."""
    file = library("ezc3d", "c3d").c3d()
    points = np.ones((4, result.places.shape[1], len(result.places)))
    points[:3] = 1000 * np.transpose(result.places, (2, 1, 0))
    point = file["parameters"]["POINT"]
    point["LABELS"]["value"] = list(result.scene.body.joint_names)
    point["RATE"]["value"] = [result.track.frame_rate]
    point["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = points
    file.write(str(path))
