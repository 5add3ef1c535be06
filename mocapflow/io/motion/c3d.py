"""Markers in C3D files (extra `c3d`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.motion.trc import METRES, seen
from mocapflow.records import F64

C3D_MARK, C3D_BLOCK = 0x50, 512  # second byte of a file; bytes of a block
BIG_ENDIAN = b"\x56"  # processor that wrote a C3D file
C3D_SIGN = {b"\x54": 15, b"\x55": 13, BIG_ENDIAN: 12}  # byte with the sign of the header's scale, by processor


def read_c3d(path: Path) -> tuple[tuple[str, ...], F64, F64, float]:
    """Read the markers of a C3D file; the result is that of `read_trc`, in the axes of the laboratory.

    Times count from the start of the measurement, of which a file may hold a part.

    Raises:
        RecordingError: ezc3d is not installed, the file can't be read or is cut off, its unit is unknown, or it has no
            rate.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise RecordingError("C3D files need ezc3d", where=str(path), hint="pip install 'mocapflow[c3d]'") from error
    try:
        if _is_cut_off(path):  # ezc3d returns what is there of the frames; within the parameters it reads on for ever
            hint = "copy or export it again"
            raise RecordingError("this C3D file is cut off", where=str(path), hint=hint)
        content = ezc3d.c3d(str(path))
    except (OSError, ValueError, RuntimeError) as error:  # ezc3d raises each of them for damaged files
        raise RecordingError(f"this C3D file can't be read: {error}", where=str(path)) from error
    point = content["parameters"]["POINT"]
    names = tuple(str(name) for name in point["LABELS"]["value"])
    unit = "".join(point["UNITS"]["value"][:1]).strip()  # a file may have none
    if unit not in METRES:
        raise RecordingError(f"unknown unit '{unit}'", where=str(path), hint=f"known: {', '.join(METRES)}")
    rate = float(point["RATE"]["value"][0])
    if not rate > 0:
        raise RecordingError("no POINT:RATE above zero", where=str(path), hint="it is in frames per second")
    positions = np.moveaxis(content["data"]["points"][:3], 0, -1).swapaxes(0, 1)[:, : len(names)] * METRES[unit]
    first = int(content["header"]["points"]["first_frame"])
    return names, seen(positions), (first + np.arange(len(positions))) / rate, rate


def _is_cut_off(path: Path) -> bool:
    """Return whether a C3D file is shorter than its header says: parameters, then frames of four numbers a point."""
    with path.open("rb") as file:
        head = file.read(18)
        if len(head) < 18 or head[1] != C3D_MARK:  # no C3D file
            return False
        file.seek(C3D_BLOCK * (head[0] - 1) + 3)
        processor = file.read(1)
    words = np.frombuffer(head, ">u2" if processor == BIG_ENDIAN else "<u2")
    points, first, last, begin = map(int, words[[1, 3, 4, 8]])
    number = 4 if head[C3D_SIGN.get(processor, 15)] & 0x80 else 2  # bytes; a scale below zero tells of floats
    least = C3D_BLOCK * (begin - 1) + (last - first + 1) * points * 4 * number
    return path.stat().st_size < max(least, C3D_BLOCK * (begin - 1) + 1)
