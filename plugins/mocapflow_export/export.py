"""Stage `export`: the track as files that other programs read."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import ClassVar, Literal

from mocapflow.components import Stage
from mocapflow.io.motion import opensim
from mocapflow.io.motion.mot import write_mot
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.io.motion.trc import write_trc
from mocapflow.recordings.recording import Recording
from mocapflow.results import Files, RunFolder, Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow_export import layout, runjson, tables
from mocapflow_export.formats import Result, need_packages, write
from mocapflow_export.quality_warnings import quality_warnings
from mocapflow_export.uncertainty import measured

LOG = logging.getLogger("mocapflow")
Format = Literal["csv", "mot", "trc", "bvh", "c3d", "gltf", "movement", "parquet", "rrd", "usd"]


class WriteFormats(Stage):
    """Writes the track in further formats, and nothing else: what `mocapflow export` does with a finished run."""

    name: ClassVar[str] = "write_formats"
    formats: tuple[Format, ...] = ("csv", "mot", "trc")  # those beyond these three, but for bvh, need their extra

    def need(self, recording: Recording) -> None:
        """Raise if a package that a format is written with is not installed."""
        for name in self.formats:
            need_packages(name)

    def run(
        self,
        track: Track,
        scene: Scene,
        recording: Recording,
        run_folder: RunFolder,
        checks: ViewChecks | None = None,
    ) -> Files:
        """Write the files and return their paths."""
        result = Result(track=track, scene=scene, recording=recording, checks=checks)
        return Files(paths=tuple(self.write(result, run_folder)))

    def write(self, result: Result, run_folder: RunFolder) -> list[Path]:
        """Write the files of a track and return their paths."""
        return [path for name in self.formats for path in written(name, result, run_folder.path)]


class Export(WriteFormats):
    """Writes results/angles.csv, angles_raw.csv and energy.csv, angles.mot, joints.trc and run.json.

    The csv of angles hold one row per frame: the angles between joint centres in degrees (`geometry.angles`), their
    calibrated standard deviations, and as `_observed` the share of each that the images determined; energy.csv
    one per turn of the loop: the terms of the functional. The mot holds signed joint angles by OpenSim's names
    (`opensim`), the trc joint centres.
    Other formats are written by `mocapflow_export.formats`.
    """

    name: ClassVar[str] = "export"

    def write(self, result: Result, run_folder: RunFolder) -> list[Path]:
        """Write the files of a track and return their paths."""
        paths, track, scene = super().write(result, run_folder), result.track, result.scene
        quality = quality_warnings(track, [camera.name for camera in scene.cameras])
        for warning in quality:
            LOG.warning(warning)
        warnings = (*result.recording.warnings, *scene.warnings, *quality)
        content = runjson.summary(track, scene.body, result.angles, run_folder, warnings)
        return [*paths, runjson.write(layout.place(run_folder.path, layout.RUN), content)]


def written(name: str, result: Result, folder: Path) -> list[Path]:
    """Write one format into a run folder and return its files."""
    own = {"csv": write_angles, "mot": write_motion, "trc": write_joints}
    return own[name](result, folder) if name in own else [write(name, result, folder / layout.RESULTS)]


def write_angles(result: Result, folder: Path) -> list[Path]:
    """Write angles.csv, angles_raw.csv and energy.csv into a run folder."""
    track = result.track
    columns = {
        layout.ANGLES: tables.angle_columns(track, result.angles),
        layout.RAW_ANGLES: tables.angle_columns(track, measured(track.before_smoothing, result.scene)),
        layout.ENERGY: tables.energy_columns(track),
    }
    return [tables.write_columns(layout.place(folder, part), each) for part, each in columns.items()]


def write_motion(result: Result, folder: Path) -> list[Path]:
    """Write angles.mot into a run folder."""
    path, track = layout.place(folder, layout.MOTION), result.track
    write_mot(path, opensim.coordinates(result.scene.body, track.root, track.angles), track.time)
    return [path]


def write_joints(result: Result, folder: Path) -> list[Path]:
    """Write joints.trc into a run folder."""
    path, track = layout.place(folder, layout.JOINTS), result.track
    places, rate = opensim_from_world(result.places), result.recording.run_rate
    write_trc(path, result.scene.body.joint_names, places, rate, start=float(track.time[0]))
    return [path]
