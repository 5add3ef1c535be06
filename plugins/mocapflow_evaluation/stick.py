"""The stick model of a reference: segments of constant length between joint centres, in the world of the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import MocapflowError, RecordingError
from mocapflow.geometry.registration import Registration, register
from mocapflow.geometry.skeleton import SEGMENTS
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.records import F64, array, record

BONES = tuple(
    (f"{start}_{side}", f"{end}_{side}") for start, end in (*SEGMENTS.values(), ("ankle", "toe")) for side in ("l", "r")
)
TRUNK = (("hip_l", "hip_r"), ("shoulder_l", "shoulder_r"), ("hip_l", "shoulder_l"), ("hip_r", "shoulder_r"))


@record
class Stick:
    """Joint centres over T frames."""

    names: tuple[str, ...]
    places: F64 = array("T", "J", 3, unit="m")

    def bones(self) -> list[tuple[int, int]]:
        """Return the pairs of joints that lines connect."""
        return [(self.names.index(a), self.names.index(b)) for a, b in (*TRUNK, *BONES) if {a, b} <= set(self.names)]


def constant(stick: Stick) -> Stick:
    """Return the model with every limb segment as long as its median, laid from the trunk outwards in its direction."""
    measured = {name: stick.places[:, k] for k, name in enumerate(stick.names)}
    laid = dict(measured)
    for start, end in BONES:
        if {start, end} <= set(measured):
            along = measured[end] - measured[start]
            length = np.linalg.norm(along, axis=1, keepdims=True)
            usual = np.nanmedian(length) if np.isfinite(length).any() else np.nan
            laid[end] = laid[start] + along / length * usual
    return Stick(names=stick.names, places=np.stack([laid[name] for name in stick.names], axis=1))


def between_points(path: Path) -> Registration:
    """Return the registration of a table of common points: x, y, z of the cameras, marker_x, _y, _z of the markers (m).

    Raises:
        RecordingError: the table can't be read or lacks a column.
        MocapflowError: the points don't tell.
    """
    columns, needed = read_columns(path), [f"{rig}{axis}" for rig in ("", "marker_") for axis in "xyz"]
    missing = [name for name in needed if name not in columns]
    if missing:
        raise RecordingError(
            f"no column {missing[0]}", where=str(path), hint=f"expected: {', '.join(needed)}; in metres"
        )
    table = np.stack([columns[name] for name in needed], axis=1)
    return register(table[:, 3:], table[:, :3])


def between_joints(ours: Stick, theirs: Stick) -> Registration | None:
    """Return the registration of joint centres that both systems have seen; None where that is not enough.

    The two systems' errors are in it: what it leaves is the least by which they can differ. Joints are left out whole.
    """
    names = common(ours, theirs)
    source, target = (_picked(stick, names).reshape(-1, 3) for stick in (theirs, ours))
    group = np.tile(np.arange(len(names)), len(ours.places))
    both = np.isfinite(source + target).all(axis=1)
    try:
        return register(source[both], target[both], group[both])
    except MocapflowError:
        return None


def distances(ours: Stick, theirs: Stick, aligned: Stick) -> list[dict[str, float | str]]:
    """Return the rows of joint_distances.csv: how far apart the centres of a joint are (mm), also without a lag."""
    rows: list[dict[str, float | str]] = []
    for name in common(ours, theirs):
        apart, without_lag = _apart(ours, theirs, name), _apart(ours, aligned, name)
        if len(apart):
            rows.append({
                "joint": name, "frames": len(apart), "mean_mm": float(np.mean(apart)),
                "median_mm": float(np.median(apart)), "p95_mm": float(np.percentile(apart, 95)),
                "max_mm": float(np.max(apart)),
                "mean_aligned_mm": float(np.mean(without_lag)) if len(without_lag) else np.nan,
            })  # fmt: skip
    return rows


def _apart(ours: Stick, theirs: Stick, name: str) -> F64:
    apart = 1000 * np.linalg.norm(_picked(ours, [name]) - _picked(theirs, [name]), axis=2)[:, 0]
    known: F64 = apart[np.isfinite(apart)]
    return known


def common(ours: Stick, theirs: Stick) -> list[str]:
    """Return the joints that both have."""
    return [name for name in ours.names if name in theirs.names]


def _picked(stick: Stick, names: Sequence[str]) -> F64:
    return stick.places[:, [stick.names.index(name) for name in names]]
