"""Pose2Sim and anipose calibration: TOML, a table for each camera, and perhaps [metadata]."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError, guess
from mocapflow.geometry import twists
from mocapflow.io.atomic import atomic_write
from mocapflow.io.cameras.from_numbers import bad, make_camera
from mocapflow.io.json_toml import place, read_toml

FIELDS = ("size", "matrix", "distortions", "rotation", "translation")
OPTIONAL = ("name", "fisheye")


def cameras(path: Path) -> tuple[Camera, ...]:
    """Read the cameras of a `.toml`, those of other programs too.

    Raises:
        RecordingError: a camera lacks a field or has one that nobody reads, or frame_rate is not under [metadata].
    """
    content = read_toml(path)
    tables = {key: table for key, table in content.items() if isinstance(table, dict) and key != "metadata"}
    if any("frame_rate" in table for table in (content, *tables.values())):
        hint = "in TOML what follows a [table] belongs to it: write it right below a line [metadata]"
        raise RecordingError("frame_rate is not under [metadata]", where=place(path, "frame_rate"), hint=hint)
    own = set(FIELDS) - {"size"}  # which a calibration board of another program has, too
    found = {key: table for key, table in tables.items() if own & set(table)}
    return tuple(_from_table(key, table, path) for key, table in found.items())


def metadata(path: Path) -> Mapping[str, Any]:
    """Return the `[metadata]` table of a TOML calibration; empty where there is none."""
    if path.suffix != ".toml":
        return {}
    found = read_toml(path).get("metadata", {})
    return found if isinstance(found, dict) else {}


def write_cameras(path: Path, cameras: Sequence[Camera]) -> None:
    """Write cameras as Pose2Sim TOML, one table each; reading it again gives the same numbers."""
    text = "\n".join(_table(camera) for camera in cameras)
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")


def _from_table(key: str, table: Mapping[str, Any], path: Path) -> Camera:
    name = str(table.get("name", key))
    missing = [field for field in FIELDS if field not in table]
    if missing:
        hint = f"each camera needs {', '.join(FIELDS)}"
        raise bad(name, path, f"lacks {', '.join(missing)}", hint)
    size, matrix, distortion, rotation, translation = (table[field] for field in FIELDS)
    for field in set(table) - {*FIELDS, *OPTIONAL}:  # other programs add fields of their own
        if meant := guess(field, (*FIELDS, *OPTIONAL)):
            raise bad(name, path, f"has a field '{field}', which nobody reads", meant)
    fisheye = table.get("fisheye", False)
    if not isinstance(fisheye, bool):
        raise bad(name, path, f"has fisheye = {fisheye!r}", "write true or false, without quotes")
    return make_camera(name, size, matrix, distortion, rotation, translation, where=path, fisheye=fisheye)


def _table(camera: Camera) -> str:
    rows = ", ".join(str([float(x) for x in row]) for row in camera.intrinsics)
    coefficients = camera.distortion[: 4 if camera.fisheye or not camera.distortion[4] else 5]
    rotation = twists.log_rotation(camera.camera_from_world[:3, :3])
    name = json.dumps(camera.name, ensure_ascii=False)  # as TOML quotes it
    return (
        f"[{name}]\nname = {name}\nsize = {camera.size.tolist()}\nmatrix = [{rows}]\n"
        f"distortions = {coefficients.tolist()}\nrotation = {rotation.tolist()}\n"
        f"translation = {camera.camera_from_world[:3, 3].tolist()}\nfisheye = {str(camera.fisheye).lower()}\n"
    )
