"""OpenCV/EasyMocap calibration: `intri.yml` with K_<name> and dist_<name>, `extri.yml` with R_<name> and T_<name>."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.cameras.from_numbers import make_camera
from mocapflow.io.json_toml import place
from mocapflow.io.paths import for_opencv
from mocapflow.records import F64

KINDS = tuple("ucwsifd")  # OpenCV's letters for kinds of numbers


def cameras(folder: Path) -> tuple[Camera, ...]:
    """Read the pair `intri.yml` and `extri.yml` of a folder.

    Raises:
        RecordingError: a file or a matrix is missing, or can't be read.
    """
    inner, outer = _open(folder / "intri.yml"), _open(folder / "extri.yml")
    names = inner.getNode("names")
    listed = names.isSeq() and all(names.at(i).isString() for i in range(names.size()))
    if not (names.empty() or listed):
        hint = 'names: ["cam01", "cam02"], and K_cam01, dist_cam01 … for each'
        raise RecordingError("names is no list of camera names", where=str(folder / "intri.yml"), hint=hint)
    return tuple(_camera(names.at(i).string(), inner, outer, folder) for i in range(names.size()))


def _camera(name: str, inner: Any, outer: Any, folder: Path) -> Camera:
    intri, extri = folder / "intri.yml", folder / "extri.yml"
    turn = outer.getNode(f"R_{name}")
    turn = outer.getNode(f"Rot_{name}") if turn.empty() else turn
    rotation = _matrix(turn, f"R_{name} and Rot_{name}", name, extri)
    translation = _matrix(outer.getNode(f"T_{name}"), f"T_{name}", name, extri)
    matrix = _matrix(inner.getNode(f"K_{name}"), f"K_{name}", name, intri)
    distortion = _matrix(inner.getNode(f"dist_{name}"), f"dist_{name}", name, intri)
    size = [_pixels(inner.getNode(f"{axis}_{name}"), f"{axis}_{name}", name, intri) for axis in "WH"]
    return make_camera(name, size, matrix, distortion, rotation, translation, where=intri)


def _open(path: Path) -> Any:
    import cv2

    if not path.is_file():
        hint = "EasyMocap calibrations are a pair: intri.yml and extri.yml"
        raise RecordingError("no such calibration file", where=str(path), hint=hint)
    try:
        storage = cv2.FileStorage(for_opencv(path), cv2.FILE_STORAGE_READ)
    except (cv2.error, SystemError) as error:
        raise RecordingError("not an OpenCV YAML file", where=str(path)) from error
    if not storage.isOpened() or not storage.root().isMap():
        raise RecordingError("not an OpenCV YAML file", where=str(path))
    return storage


def _pixels(node: Any, key: str, name: str, path: Path) -> float:
    """Return how many pixels a size has; 0 where it is not there. OpenCV would read a text as the largest number."""
    if not (node.empty() or node.isInt() or node.isReal()):
        raise RecordingError(f"camera '{name}' has no number in {key}", where=place(path, key), hint="it is in pixels")
    return float(node.real())


def _matrix(node: Any, key: str, name: str, path: Path) -> F64:
    """Return the numbers (N,) of a matrix; `node.mat()` would write beyond its memory where `cols` is missing."""
    if node.empty():
        raise RecordingError(f"camera '{name}' lacks {key}", where=str(path))
    found = _numbers(node) if node.isMap() else None
    if found is None:
        hint = "expected !!opencv-matrix with rows, cols, dt, and as many numbers in data"
        raise RecordingError(f"camera '{name}' has no matrix in {key}", where=place(path, key), hint=hint)
    return found


def _numbers(node: Any) -> F64 | None:
    """Return the numbers (N,) of a mapping with rows, cols, dt and data, None where these do not go together."""
    rows, columns, kind, data = (node.getNode(part) for part in ("rows", "cols", "dt", "data"))
    if not (rows.isInt() and columns.isInt() and data.isSeq() and kind.isString() and kind.string() in KINDS):
        return None
    count = int(rows.real()) * int(columns.real())
    values = [data.at(k) for k in range(data.size())]
    numbers = [value.real() for value in values if value.isReal() or value.isInt()]
    return np.array(numbers) if count == len(numbers) == len(values) else None
