"""Reference curves to compare with: csv as in truth/, OpenSim motions, joint centres or markers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry import angles
from mocapflow.io import markers
from mocapflow.records import F64
from mocapflow_sequence import tables

MOTION = {"knee_angle": "knee_flexion", "hip_flexion": "hip_flexion", "ankle_angle": "ankle", "elbow_flex": "elbow"}
MARKERS = {
    "Hip": "hip",
    "Knee": "knee",
    "Ankle": "ankle",
    "BigToe": "toe",
    "Shoulder": "shoulder",
    "Elbow": "elbow",
    "Wrist": "wrist",
}


def read_reference(path: Path) -> dict[str, F64]:
    """Return reference curves (T,) in degrees by our names, with `frame` or `time` (s) beside them.

    A csv has our columns. Of a .mot the columns that mean the same are taken, by OpenSim's names; their zeros are
    the model's own, so that only knees and elbows compare without an offset. Of a .trc with joint centres, named
    as ours (hip_l) or as Pose2Sim's (LHip), the three-point angles are computed.

    Raises:
        RecordingError: the file is missing, of another kind, or has none of our angles.
    """
    readers = {".csv": tables.read_columns, ".mot": _motion, ".sto": _motion, ".trc": _joint_centres}
    if path.suffix.lower() not in readers:
        raise RecordingError(
            f"can't compare with a {path.suffix or 'file without ending'}",
            where=str(path),
            hint="use .csv, .mot or .trc",
        )
    if not path.is_file():
        raise RecordingError("no such reference", where=str(path))
    curves = readers[path.suffix.lower()](path)
    if not ({"frame", "time"} & set(curves)):
        raise RecordingError("the reference has neither a column frame nor time", where=str(path))
    return curves


def _motion(path: Path) -> dict[str, F64]:
    columns, time = markers.read_mot(path)
    curves = {"time": from_zero(time)}
    for theirs, ours in MOTION.items():
        for side in ("l", "r"):
            if f"{theirs}_{side}" in columns:
                curves[f"{ours}_{side}"] = columns[f"{theirs}_{side}"]
    for side in ("l", "r"):  # gait2392 counts knee flexion as negative
        if np.mean(curves.get(f"knee_flexion_{side}", 0.0)) < 0:
            curves[f"knee_flexion_{side}"] = -curves[f"knee_flexion_{side}"]
    return curves


def _joint_centres(path: Path) -> dict[str, F64]:
    theirs, positions, time, _ = markers.read_trc(path)
    known = {f"{s.upper()}{name}": f"{ours}_{s}" for name, ours in MARKERS.items() for s in ("l", "r")}
    names = tuple(known.get(name, name) for name in theirs)
    curves = {"time": from_zero(time)}
    for wish in angles.definitions(names):
        if len(wish.points) == 3:
            points = positions[:, [names.index(p) for p in wish.points]]
            curves[wish.name] = angles.three_point(points) + wish.offset
    return curves


def from_zero(time: F64) -> F64:
    """Return times (T,) s whose first video frame is at 0: some programs (Pose2Sim) put it at one sample."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return time - step if step > 0 and abs(time[0] - step) < 0.01 * step else time
