"""C3D: joint centres as markers, for biomechanics programs; mm, axes of the world."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.errors import PipelineError
from mocapflow_export.formats.result import Result, library

LAST = 65534  # frame that the header can name: it counts from 1, in 16 bits


def write(result: Result, path: Path) -> None:
    """Write the joint centres at the frames of the video, of which the format only knows the first and the rate.

    Frames between, that the run left out, are those of markers that were not seen.
    """
    file = library("ezc3d", "c3d").c3d()
    first, last = int(result.track.frame[0]), int(result.track.frame[-1])
    points = np.full((4, result.places.shape[1], last - first + 1), np.nan)
    points[:3, :, result.track.frame - first] = 1000 * np.transpose(result.places, (2, 1, 0))
    if first > LAST:
        raise PipelineError(f"C3D can't say that a track begins at frame {first}", hint=f"it counts frames to {LAST}")
    point = file["parameters"]["POINT"]
    point["LABELS"]["value"] = list(result.scene.body.joint_names)
    point["RATE"]["value"] = [result.recording.frame_rate]
    point["UNITS"]["value"] = ["mm"]
    file["header"]["points"]["first_frame"] = first
    file["data"]["points"] = points
    file.write(str(path))
