"""Reference curves to compare with: csv as in truth/, OpenSim motions, joint centres or markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from mocapflow_export import tables

from mocapflow.errors import RecordingError
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.mot import read_mot
from mocapflow.records import F64, array, record
from mocapflow_evaluation import true_joints
from mocapflow_evaluation.measured_points import SUFFIXES as POINTS
from mocapflow_evaluation.measured_points import measured_centres
from mocapflow_evaluation.tracked_motion import SIGNED

MOTION = {"knee_angle": "knee_flexion", "hip_flexion": "hip_flexion", "ankle_angle": "ankle", "elbow_flex": "elbow"}
SLACK = 0.03  # of a sample: times in files are rounded
SPARSE = 1.0  # s between samples; between such that are farther apart a curve would be made up
AROUND = 360.0  # deg; no angle between two bones is larger
SUFFIXES = (".csv", ".mot", ".sto", *POINTS)


@record
class Reference:
    """What another system has measured."""

    curves: Mapping[str, F64]  # (T,) deg by our names
    at: F64 = array("T", unit="frames of the video or s, see by_frame")
    by_frame: bool  # rows belong to frames; else to times
    joint_names: tuple[str, ...] = ()
    joints: F64 | None = array("T", "J", 3, unit="m, in the axes of its own rig, z up", default=None)
    in_our_world: bool = False  # its rig is that of the cameras: nothing is registered
    notes: tuple[str, ...] = ()  # how it was read, where that is not plain
    time: F64 | None = array("T", unit="s, where a table has times", default=None)
    counted_from: float = 0.0  # s; some programs begin to count time at one sample

    @property
    def step(self) -> float:
        """From one sample to the next, in the unit of `at`; frames that are missing stay so."""
        return 1.0 if self.by_frame or len(self.at) < 2 else float(np.median(np.diff(self.at)))

    def moments(self, ours: F64) -> F64:
        """Return its `at` (T,) as our clock (U,) has it: counted from 0, but for a run that begins where it does."""
        begins_with_us = len(self.at) > 0 and abs(ours[0] - self.at[0]) < SLACK * self.step
        return self.at if begins_with_us else self.at - self.counted_from


def read_reference(path: Path) -> Reference:
    """Return the reference in a file.

    A csv has our columns, degrees, by frame or time; beside one by frame may lie its joint centres (`true_joints`). Of
    a .mot the columns that mean the same are taken, by OpenSim's names; their zeros are the model's own, so that only
    knees and elbows compare without an offset. A .trc or .c3d holds joint centres, named as ours (hip_l) or as
    Pose2Sim's (LHip), or markers on bony landmarks (`marker_names`), from which joint centres and knee axes are found
    (`marker_joints`). Inner markers that it lacks may be in a standing trial beside it (`static_trial`).

    Raises:
        RecordingError: the file is missing, of another kind, has none of our angles, or one that turns more than once
            around, goes back in time, or has its samples far apart.
    """
    readers = {".csv": _table, ".mot": _motion, ".sto": _motion, ".trc": _trc, ".c3d": _points}
    if not path.is_file():
        raise RecordingError("no such reference", where=str(path))
    if path.suffix.lower() not in readers:
        hint = f"known: {', '.join(SUFFIXES)}, and folders like keypoints/"
        raise RecordingError(f"can't compare with a {path.suffix or 'file without ending'}", where=str(path), hint=hint)
    reference = readers[path.suffix.lower()](path)
    _check(reference, path)
    return reference


def _check(reference: Reference, path: Path) -> None:
    """Raise where the samples of a reference are not one curve in time, or its angles are none."""
    grows = np.diff(reference.at) > 0  # what is interpolated has to; nan does not
    if not grows.all():
        row, clock = int(np.argmin(grows)) + 1, "frame" if reference.by_frame else "time"
        hint = "one row for each moment, in their order"
        raise RecordingError(f"the {clock} does not grow from row {row} to row {row + 1}", where=str(path), hint=hint)
    if not reference.by_frame and reference.step > SPARSE:
        what = f"its samples are {reference.step:.4g} s apart: too far to compare with what lies between them"
        raise RecordingError(what, where=str(path), hint="times are in seconds; are these milliseconds?")
    for name, curve in reference.curves.items():
        if (size := float(np.nanmax(np.abs(curve), initial=0.0))) > AROUND:
            hint = "angles are in degrees; mend or leave out this column"
            raise RecordingError(f"{name} reaches {size:.0f}°, more than once around", where=str(path), hint=hint)


def _table(path: Path) -> Reference:
    columns = read_columns(path)
    clock = next((name for name in ("frame", "time") if name in columns), None)
    if clock is None:
        raise RecordingError("the reference has neither a column frame nor time", where=str(path))
    curves = {name: columns[name] for name in tables.angle_names(columns)}
    found = Reference(curves=curves, at=columns[clock], by_frame=clock == "frame", time=columns.get("time"))
    known = true_joints.beside(path, found.at) if found.by_frame else None
    return found if known is None else replace(found, joint_names=known.names, joints=known.places, in_our_world=True)


def _motion(path: Path) -> Reference:
    columns, time = read_mot(path)
    named = {f"{theirs}_{side}": f"{ours}_{side}" for theirs, ours in MOTION.items() for side in ("l", "r")}
    curves = {ours: columns[theirs] for theirs, ours in named.items() if theirs in columns}
    curves |= {name: columns[name] for name in SIGNED if name in columns}
    start, notes = counted_from(time)
    if offset := [name for name in curves if not name.startswith(("knee", "elbow"))]:
        notes = (*notes, f"OpenSim has zeros of its own, so these may be off by a constant: {', '.join(offset)}")
    return Reference(curves=curves, at=time, by_frame=False, notes=notes, counted_from=start)


def _trc(path: Path) -> Reference:
    reference = _points(path)
    start, notes = counted_from(reference.at)
    return replace(reference, notes=(*notes, *reference.notes), counted_from=start)


def _points(path: Path) -> Reference:
    found = measured_centres(path)
    return Reference(
        curves=found.curves,
        at=found.time,
        by_frame=False,
        joint_names=tuple(found.centres),
        joints=np.stack(list(found.centres.values()), axis=1),
        notes=found.notes,
    )


def counted_from(time: F64) -> tuple[float, tuple[str, ...]]:
    """Return where times (T,) s seem to be counted from: one sample where they begin there; and a note."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step > 0 and abs(time[0] - step) < SLACK * step:
        said = (
            f"the reference counts time from {time[0]:.4f} s, one sample: taken as 0, unless our first frame is there"
        )
        return step, (said,)
    return 0.0, ()
