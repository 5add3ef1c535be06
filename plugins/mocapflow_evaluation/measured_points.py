"""Joint centres and angles from the points that another system has measured: joint centres, or markers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry import angles
from mocapflow.io.motion.c3d import read_c3d
from mocapflow.io.motion.opensim_axes import world_from_opensim
from mocapflow.io.motion.trc import read_trc
from mocapflow.records import F64
from mocapflow_evaluation import marker_joints, static_trial
from mocapflow_evaluation.marker_names import FILE, landmarks
from mocapflow_evaluation.static_trial import Trial

SUFFIXES = (".trc", ".c3d")
POSE2SIM = {
    "Hip": "hip", "Knee": "knee", "Ankle": "ankle", "BigToe": "toe", "Heel": "heel",
    "Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist",
}  # fmt: skip


class Measured(NamedTuple):
    """What the points of a file tell."""

    centres: Mapping[str, F64]  # (T, 3) m by joint, z up
    curves: Mapping[str, F64]  # (T,) deg by angle
    time: F64  # (T,) s
    notes: tuple[str, ...] = ()  # how it was found, where that is not plain


def measured_centres(path: Path) -> Measured:
    """Return what the joint centres of a file tell, or its markers.

    Raises:
        RecordingError: it can't be read, or has neither.
    """
    labels, positions, time = _points(path)
    known = {f"{s.upper()}{name}": f"{ours}_{s}" for name, ours in POSE2SIM.items() for s in ("l", "r")}
    centres = dict(zip((known.get(label, label) for label in labels), np.moveaxis(positions, 1, 0), strict=True))
    if curves := angles.between_centres(centres):
        return Measured(centres, curves, time)
    marks, notes = _marks(path, labels, positions)
    if not (centres := marker_joints.joint_centres(marks)):
        said, known_by = "these are neither joint centres nor markers that are known", path.parent / FILE
        hint = f'name the landmarks in {known_by}: knee_lateral_l = "…"; the markers are {", ".join(labels)}'
        raise RecordingError(said, where=str(path), hint=hint)
    found = f"joint centres and knee axes from {len(marks)} markers on bony landmarks"
    return Measured(centres, angles.between_centres(centres) | _about_axes(marks, centres), time, (found, *notes))


def _points(path: Path) -> tuple[tuple[str, ...], F64, F64]:
    """Return the names of points, where they are (T, K, 3) m, z up, and the time (T,) s."""
    if path.suffix.lower() == ".trc":
        names, positions, time, _ = read_trc(path)
        return names, world_from_opensim(positions), time
    names, positions, time, _ = read_c3d(path)
    return names, positions, time


def _marks(path: Path, labels: tuple[str, ...], positions: F64) -> tuple[Mapping[str, F64], tuple[str, ...]]:
    """Return the landmarks (T, 3) m of a motion, inner ones from a standing trial beside it too, and what to say."""
    file = static_trial.file_beside(path, SUFFIXES)
    if file is None:
        return _trial(labels, positions, path.parent).landmarks, ()
    standing_labels, standing, _ = _points(file)
    moving = _trial(labels, positions, path.parent, standing_labels)
    still = static_trial.standing(_trial(standing_labels, standing, path.parent, labels), file)
    found, lacking = static_trial.carried(moving, still)
    notes = []
    if found:
        notes.append(f"{', '.join(found)} as they stood in {file.name}, carried along by the segments above")
    if lacking:
        why = "for that a segment needs both ends and one more marker between them, in both trials"
        notes.append(f"{', '.join(lacking)} of {file.name} can't be carried along: {why}")
    return {**moving.landmarks, **found}, tuple(notes)


def _trial(labels: tuple[str, ...], positions: F64, folder: Path, others: tuple[str, ...] = ()) -> Trial:
    """Return the markers of a file; `others` are names in the other file of a pair."""
    shown = landmarks(labels, folder, others)
    free = sorted(set(range(len(labels))) - set(shown.values()))
    return Trial(
        landmarks={name: positions[:, index] for name, index in shown.items()},
        others={labels[index].rpartition(":")[2]: positions[:, index] for index in free},
    )


def _about_axes(marks: Mapping[str, F64], centres: Mapping[str, F64]) -> dict[str, F64]:
    """Return the angles that need more than joint centres: hip flexion, and the knee's turn about its own axis."""
    found = {}
    for side in ("l", "r"):
        hip, knee, ankle = (centres.get(f"{joint}_{side}") for joint in ("hip", "knee", "ankle"))
        if hip is not None and knee is not None:
            found[f"hip_flexion_{side}"] = angles.hip_flexion(knee - hip, marker_joints.pelvis_axes(marks)[:, :2])
            if ankle is not None:
                axis = marker_joints.knee_axis(marks, side)
                found[f"knee_angle_{side}"] = marker_joints.signed_flexion(hip, knee, ankle, axis)
    return found
