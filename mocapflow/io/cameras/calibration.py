"""Calibration files: Pose2Sim/anipose TOML, Qualisys .qca.txt, OpenCV/EasyMocap intri.yml and extri.yml."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import bends
from mocapflow.io.cameras import opencv, pose2sim, qualisys
from mocapflow.io.cameras.from_numbers import bad

FARTHEST = 100.0  # m; a camera further from the origin is one calibrated in centimetres
MILLIMETRES = 1000.0  # m; beyond, in millimetres
SKEW = 0.1  # px; a camera matrix with more does not go with a distorted lens: OpenCV's model of one has none
YAML = (".yml", ".yaml")


def read_cameras(path: Path) -> tuple[Camera, ...]:
    """Read the cameras of a calibration file of any known format, in the order of the file.

    Args:
        path: a `.toml`, a Qualisys `.qca.txt`, an `intri.yml` with `extri.yml` beside it, or a recording folder.

    Returns:
        The cameras with their lens distortion. A size of 0 x 0 means that the file does not say.

    Raises:
        RecordingError: the file is missing, incomplete, not a calibration, not in metres, or has its
            frame rate where nobody looks for it.
    """
    path = find_calibration(path) if path.is_dir() else path
    if not path.is_file():
        raise RecordingError("no such calibration file", where=str(path))
    if path.suffix == ".toml":
        cameras = pose2sim.cameras(path)
    elif path.suffix in YAML:
        cameras = opencv.cameras(path.parent)
    else:
        cameras = qualisys.cameras(path)
    if not cameras:
        raise RecordingError("the file holds no camera", where=str(path))
    names = [camera.name for camera in cameras]
    for camera in cameras:
        _check(camera, path)
        if names.count(camera.name) > 1:
            raise bad(camera.name, path, "is there more than once")
    return cameras


def find_calibration(folder: Path) -> Path:
    """Return the calibration file of a recording folder.

    Raises:
        RecordingError: there is none, or more than one Qualisys file.
    """
    if (folder / "cameras.toml").exists():
        return folder / "cameras.toml"
    found = sorted(folder.glob("[!.]*.qca.txt")) or [p for p in [folder / "intri.yml"] if p.exists()]
    if len(found) == 1:
        return found[0]
    raise RecordingError(
        "no calibration file" if not found else f"{len(found)} calibration files: {', '.join(p.name for p in found)}",
        where=str(folder),
        hint="put the calibration there as cameras.toml (Pose2Sim or anipose),\n"
        "as one Qualisys *.qca.txt, or as intri.yml and extri.yml (EasyMocap)",
    )


def calibration_files(path: Path) -> tuple[Path, ...]:
    """Return the files that `read_cameras` reads for a path: EasyMocap calibrations are a pair."""
    return (path.with_name("intri.yml"), path.with_name("extri.yml")) if path.suffix in YAML else (path,)


def _check(camera: Camera, path: Path) -> None:
    k, rotation = camera.intrinsics, camera.camera_from_world[:3, :3]
    if not (k[0, 0] > 0 and k[1, 1] > 0 and k[2, 2] == 1) or k[1, 0] or k[2, 0] or k[2, 1]:
        raise bad(camera.name, path, "has no camera matrix", "expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels")
    if abs(k[0, 1]) > SKEW and bends(camera):
        hint = "lens distortion is corrected without skew: calibrate with a skew of 0, as OpenCV always does"
        raise bad(camera.name, path, f"has a skew of {k[0, 1]:g} px", hint)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
        hint = "its rows must be orthonormal, with determinant +1"
        raise bad(camera.name, path, "has a matrix that is not a rotation", hint)
    distance = float(np.linalg.norm(camera.camera_from_world[:3, 3]))
    if distance > FARTHEST:
        unit, factor = ("mm", 1000) if distance > MILLIMETRES else ("cm", 100)
        hint = f"lengths are in metres: divide every translation by {factor}"
        hint += ";\nif their unit is a square of the calibration board, multiply by its side" if factor == 100 else ""
        raise bad(camera.name, path, f"stands {distance:.0f} m from the origin: the calibration is in {unit}", hint)
