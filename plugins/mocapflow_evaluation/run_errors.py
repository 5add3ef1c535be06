"""The errors of a finished run, frame by frame, read back from its folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mocapflow_export import layout

from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.records import F64


class Errors(NamedTuple):
    """By how much each angle was off."""

    frame: F64  # (T,)
    angles: Mapping[str, F64]  # each (T,) deg

    def at(self, frame: F64) -> dict[str, F64]:
        """Return the errors of each angle at other frames (U,); NaN at those that were not compared."""
        _, wanted, known = np.intersect1d(frame, self.frame, return_indices=True)
        found = {name: np.full(len(frame), np.nan) for name in self.angles}
        for name, error in self.angles.items():
            found[name][wanted] = error[known]
        return found


def angle_errors(run: Path | str) -> Errors:
    """Return the errors of each angle that was compared in a run; none without a reference, or where it failed."""
    if isinstance(run, str) or not (run / layout.ERRORS).is_file():
        return Errors(np.empty(0), {})
    columns = read_columns(run / layout.ERRORS)
    return Errors(columns.pop("frame"), columns)
