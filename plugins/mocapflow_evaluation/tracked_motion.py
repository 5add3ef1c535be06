"""The tracked side of a comparison: angles and joint centres of a track, or of the files of a run folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mocapflow_export import layout, tables
from mocapflow_export.uncertainty import measured

from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.io.motion import opensim
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.mot import read_mot
from mocapflow.io.motion.opensim_axes import world_from_opensim
from mocapflow.io.motion.trc import read_trc
from mocapflow.records import F64, record
from mocapflow.results import Track, frame_rate_of
from mocapflow.scene import Scene
from mocapflow_evaluation.stick import Stick

SIGNED = ("knee_angle_l", "knee_angle_r")  # of angles.mot: about the axis of the knee, not between joint centres


@record
class TrackedMotion:
    """What is compared with a reference."""

    columns: Mapping[str, F64]  # of angles.csv, and the signed angles of the knees
    raw: Mapping[str, F64]  # the same before smoothing
    stick: Stick
    flagged_share: float = np.nan  # of the frames that are lost, doubted or not at rest; NaN where no run tells

    @property
    def frame_rate(self) -> float:
        """Frames per second, 30 where a single frame does not tell."""
        return frame_rate_of(self.columns["time"])


def of_track(track: Track, scene: Scene) -> TrackedMotion:
    """Return what a track has."""
    places = kinematics.joint_centres(scene.body, track.root, track.angles)
    columns, raw = (_columns(each, scene) for each in (track, track.before_smoothing))
    flagged = track.lost | track.doubted | ~track.steady
    stick = Stick(names=scene.body.joint_names, places=places)
    return TrackedMotion(columns=columns, raw=raw, stick=stick, flagged_share=float(np.mean(flagged)))


def of_folder(folder: Path) -> TrackedMotion:
    """Return what the files of a run folder have.

    Raises:
        RecordingError: the run folder has no angles.
    """
    path = folder / layout.ANGLES
    if not path.is_file():
        hint = "a run folder is what `mocapflow run` writes; the stage `export` writes this file"
        raise RecordingError("there are no angles to compare", where=str(path), hint=hint)
    columns = read_columns(path)
    raw = folder / layout.RAW_ANGLES
    motion = read_mot(folder / layout.MOTION)[0] if (folder / layout.MOTION).is_file() else {}
    return TrackedMotion(
        columns=columns | {name: motion[name] for name in SIGNED if name in motion},
        raw=read_columns(raw) if raw.is_file() else columns,
        stick=_stick(folder / layout.JOINTS, len(columns["frame"])),
        flagged_share=_flagged_share(folder / layout.RUN),
    )


def _flagged_share(path: Path) -> float:
    if not path.is_file():
        return np.nan
    frames = json.loads(path.read_text(encoding="utf-8")).get("frames", {})
    if not {"lost", "doubted", "not_at_rest", "count"} <= frames.keys():  # of an earlier version, or of another plugin
        return np.nan
    flagged = {*frames["lost"], *frames["doubted"], *frames["not_at_rest"]}
    return len(flagged) / int(frames["count"])


def _columns(track: Track, scene: Scene) -> dict[str, F64]:
    coordinates = opensim.coordinates(scene.body, track.root, track.angles)
    signed = {name: coordinates[name] for name in SIGNED if name in coordinates}
    return tables.angle_columns(track, measured(track, scene)) | signed


def _stick(path: Path, frames: int) -> Stick:
    if not path.is_file():
        return Stick(names=(), places=np.empty((frames, 0, 3)))
    names, places, _, _ = read_trc(path)
    return Stick(names=names, places=world_from_opensim(places))
