"""The joint centres of the truth: joints.npz beside its table of angles, in the world of the cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.records import F64
from mocapflow_evaluation.stick import Stick

FILE = "joints.npz"  # positions (T, J, 3) m, row i of frame i; names (J,)


def beside(table: Path, frames: F64) -> Stick | None:
    """Return the joint centres at the frames (T,) of a table of angles; None where no file of them lies beside it.

    Raises:
        RecordingError: the file can't be read, or lacks one of the frames.
    """
    path = table.with_name(FILE)
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream) as content:
            names, positions = tuple(map(str, content["names"])), np.asarray(content["positions"], np.float64)
    except Exception as error:  # of numpy, zipfile and zlib: what is cut off or no archive may raise any
        raise RecordingError(f"can't be read: {error}", where=str(path), hint="positions (T, J, 3) m, names") from error
    if positions.shape[1:] != (len(names), 3):
        what = f"positions have shape {positions.shape}, expected (T, {len(names)}, 3): there are {len(names)} names"
        raise RecordingError(what, where=str(path))
    known = np.isin(frames, np.arange(len(positions)))
    if not known.all():
        hint = f"its row i is frame i of the videos; frames as in {table.name}"
        what = f"frame {frames[~known][0]:g} is not among its {len(positions)} rows"
        raise RecordingError(what, where=str(path), hint=hint)
    return Stick(names=names, places=positions[frames.astype(int)])
