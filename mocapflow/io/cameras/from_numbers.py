"""A camera from the numbers of a calibration file, checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.geometry import twists
from mocapflow.io.json_toml import place
from mocapflow.io.paths import composed
from mocapflow.records import F64

FEWER = (
    "write 2, 4 or 5 of them, in this order: k1 k2 p1 p2 k3; with more, calibrate again without OpenCV's\n"
    "CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL: the first 5 alone are no model"
)


def make_camera(
    name: str,
    size: Any,
    intrinsics: Any,
    distortion: Any,
    rotation: F64,
    translation: Any,
    *,
    where: Path,
    fisheye: bool = False,
) -> Camera:
    """Return a camera from the numbers of a file; `rotation` is a Rodrigues vector or a 3 x 3 matrix.

    Raises:
        RecordingError: an array has the wrong length, the size is none, or the rotation is none, or in degrees.
    """
    pixels = _numbers(size, (2,), "size", name, where)
    if not ((pixels >= 0) & (pixels < np.iinfo(np.int32).max)).all():
        raise bad(name, where, f"has the size {pixels[0]:g} x {pixels[1]:g}")
    motion = np.eye(4)
    motion[:3, 3] = _numbers(translation, (3,), "translation", name, where)
    if _count(rotation) == 9:
        motion[:3, :3] = _numbers(rotation, (3, 3), "rotation", name, where)
    else:
        vector = _numbers(rotation, (3,), "rotation", name, where)
        if (turn := float(np.linalg.norm(vector))) > 2 * np.pi:
            hint = "rotation is a Rodrigues vector in radians, camera from world"
            raise bad(name, where, f"turns by {turn:.1f} rad, more than once around: it looks like degrees", hint)
        motion[:3, :3] = twists.exp(np.concatenate([vector, np.zeros(3)]))[:3, :3]
    coefficients = _coefficients(distortion, fisheye, name, where)
    return Camera(
        name=composed(name),
        size=pixels.astype(np.int32),
        intrinsics=_numbers(intrinsics, (3, 3), "matrix", name, where),
        distortion=np.pad(coefficients, (0, 5 - len(coefficients))),
        camera_from_world=motion,
        fisheye=fisheye,
    )


def _coefficients(distortion: Any, fisheye: bool, name: str, where: Path) -> F64:
    """Return at most 5 coefficients of a lens, without the zeros behind those that are known."""
    found = _numbers(distortion, (_count(distortion),), "distortions", name, where)
    known = 4 if fisheye else 5
    # three may be k1 k2 k3 or k1 k2 p1: OpenCV has no such list
    if found[known:].any() or (len(found) == 3 and found[2]):
        hint = "a fisheye has 4: k1 k2 k3 k4" if fisheye else FEWER
        raise bad(name, where, f"has {len(found)} distortion coefficients", hint)
    return found[:known]


def _count(value: Any) -> int:
    """Return how many numbers a field holds; 0 where rows of it have other lengths than others."""
    try:
        return int(np.size(value))
    except ValueError:
        return 0


def _numbers(value: Any, shape: tuple[int, ...], field: str, name: str, where: Path) -> F64:
    """Return a field's numbers in the shape it must have.

    Raises:
        RecordingError: they are no numbers, not finite, or too many or few.
    """
    try:
        found = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise bad(name, where, f"has no numbers in {field}: {value!r}") from None
    if found.size != int(np.prod(shape)):
        raise bad(name, where, f"has {found.size} numbers in {field}; expected {int(np.prod(shape))}")
    if not np.isfinite(found).all():
        hint = "calibrate this camera again, or mend the file by hand"
        raise bad(name, where, f"has NaN or infinity in {field}", hint)
    return found.reshape(shape)


def bad(name: str, where: Path, what: str, hint: str = "") -> RecordingError:
    """Return the error that says what is wrong with a camera."""
    return RecordingError(f"camera '{name}' {what}", where=place(where, name), hint=hint)
