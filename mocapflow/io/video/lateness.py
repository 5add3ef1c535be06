"""recording.json: which cameras of a recording are late."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mocapflow.errors import RecordingError, alternatives
from mocapflow.io.atomic import atomic_write
from mocapflow.io.json_toml import place, read_json
from mocapflow.io.paths import composed

TIMING = "recording.json"
FORM = 'expected {"late_frames": {"cam03": 2.8}}: by how many frames its pictures come after those of the others'


def late_frames(folder: Path, names: Sequence[str]) -> tuple[int, ...]:
    """Return by how many whole frames each camera is late; 0 where nothing is said.

    Raises:
        RecordingError: the file is not in its form, names a camera that is not there, or moves all cameras one way.
    """
    path = folder / TIMING
    if not path.exists():
        return (0,) * len(names)
    content = read_json(path, FORM)
    if isinstance(content, dict) and (strange := sorted(content.keys() - {"late_frames"})):
        raise RecordingError(f"unknown setting '{strange[0]}'", where=place(path, strange[0]), hint=FORM)
    try:
        late = {composed(name): _rounded(frames) for name, frames in content["late_frames"].items()}
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        raise RecordingError(f"does not say how late the cameras are: {error!r}", where=str(path), hint=FORM) from error
    if unknown := sorted(set(late) - set(names)):
        name, hint = unknown[0], alternatives(unknown[0], names)
        raise RecordingError(f"there is no camera '{name}'", where=place(path, name), hint=hint)
    counts = [late.get(name, 0) for name in names]
    if min(counts) > 0 or max(counts) < 0:
        hint = f"cameras are late after others: take {min(counts, key=abs)} off each"
        raise RecordingError("every camera is said to be late, or every one early", where=str(path), hint=hint)
    return tuple(counts)


def _rounded(frames: Any) -> int:
    if isinstance(frames, bool):
        raise TypeError("true and false are no numbers of frames")
    return round(float(frames))


def timing_text(late: Mapping[str, float]) -> str:
    """Return what recording.json says, to a hundredth of a frame: a tenth makes 3.5 of 3.46, which is read as 4."""
    return json.dumps({"late_frames": {name: round(frames, 2) for name, frames in late.items()}})


def write_late_frames(folder: Path, late: Mapping[str, float]) -> Path:
    """Write which cameras are late.

    Raises:
        RecordingError: the folder can't be written.
    """
    path = folder / TIMING
    try:
        with atomic_write(path) as part:
            part.write_text(timing_text(late) + "\n")
    except OSError as error:
        raise RecordingError(f"can't be written: {error.strerror}", where=str(path)) from error
    return path
