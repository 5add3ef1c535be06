"""Marker and motion files: OpenSim TRC, MOT and STO, and C3D (extra `c3d`).

OpenSim's axes are x forward, y up, z right; the world here is z up. `opensim_from_world` and
`world_from_opensim` permute cyclically, as Pose2Sim does: OpenSim (x, y, z) = world (y, z, x).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.atomic import atomic_write
from mocapflow.io.motion.csv_columns import row_of_numbers
from mocapflow.records import F64

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
C3D_MARK, C3D_BLOCK = 0x50, 512  # second byte of a file; bytes of a block
BIG_ENDIAN = b"\x56"  # processor that wrote a C3D file
C3D_SIGN = {b"\x54": 15, b"\x55": 13, BIG_ENDIAN: 12}  # byte with the sign of the header's scale, by processor
SHIFTS = ("_tx", "_ty", "_tz")  # OpenSim's names of coordinates that are lengths, not angles


def opensim_from_world(positions: F64) -> F64:
    """Return positions (..., 3) of a z-up world in OpenSim's y-up axes."""
    return positions[..., [1, 2, 0]]


def world_from_opensim(positions: F64) -> F64:
    """Return positions (..., 3) in OpenSim's y-up axes in the z-up world."""
    return positions[..., [2, 0, 1]]


def write_trc(path: Path, names: Sequence[str], positions: F64, frame_rate: float, *, start: float = 0.0) -> None:
    """Write marker positions.

    Args:
        path: the file.
        names: K marker names.
        positions: (T, K, 3) m, in OpenSim's axes; NaN where a marker is not seen.
        frame_rate: per second.
        start: time of the first row, s.
    """
    count = len(positions)
    axes = [f"{axis}{k}" for k in range(1, len(names) + 1) for axis in "XYZ"]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{frame_rate:g}\t{frame_rate:g}\t{count}\t{len(names)}\tm\t{frame_rate:g}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(axes),
        "",
    ]
    for row, markers in enumerate(positions):
        cells = ["" if np.isnan(x) else f"{x:.8f}" for x in markers.ravel()]
        lines.append("\t".join([str(row + 1), f"{start + row / frame_rate:.8f}", *cells]))
    with atomic_write(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_trc(path: Path) -> tuple[tuple[str, ...], F64, F64, float]:
    """Read marker positions.

    Returns:
        names (K), positions (T, K, 3) m in the axes of the file (see `world_from_opensim`), time (T,) s and the
        frame rate; markers that are not seen (no numbers, or three zeros) are NaN.

    Raises:
        RecordingError: not a TRC file, no markers, an unknown unit, no rate, no row, or one of another width.
    """
    lines = _text(path).splitlines()
    if not lines or not lines[0].startswith("PathFileType"):
        raise RecordingError("not a TRC file: its first word is not PathFileType", where=str(path))
    if not any(map(str.strip, lines[5:])):
        raise RecordingError("there is no row of positions below the header", where=str(path))
    header = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
    names = tuple(name for name in (cell.strip() for cell in lines[3].split("\t")[2:]) if name)
    if not names:
        raise RecordingError("no marker is named", where=f"{path}:4")
    unit = header.get("Units", "").strip()
    if unit not in METRES:
        raise RecordingError(f"unknown unit '{unit}'", where=str(path), hint=f"known: {', '.join(METRES)}")
    (rate,) = row_of_numbers([header.get("DataRate", "")], 1, f"{path}:3")
    if not rate > 0:
        raise RecordingError("no DataRate above zero", where=f"{path}:3", hint="it is in rows per second")
    width = 2 + 3 * len(names)
    rows = [
        row_of_numbers(_fitted(line.split("\t"), width), width, f"{path}:{number}")
        for number, line in enumerate(lines[5:], 6)
        if line.strip()
    ]
    table = np.array(rows).reshape(-1, width)
    positions = _seen(table[:, 2:].reshape(-1, len(names), 3) * METRES[unit])
    return names, positions, table[:, 1].copy(), rate


def write_mot(path: Path, columns: Mapping[str, F64], time: F64) -> None:
    """Write coordinates over time, with OpenSim's names and signs.

    Args:
        path: the file.
        columns: each (T,); angles in degrees, pelvis_tx, _ty, _tz in m.
        time: (T,) s.
    """
    lines = [
        path.stem, "version=1", f"nRows={len(time)}", f"nColumns={len(columns) + 1}",
        "inDegrees=yes", "endheader", "\t".join(["time", *columns]),
    ]  # fmt: skip
    table = np.column_stack([time, *columns.values()])
    lines += ["\t".join(f"{x:.8f}" for x in row) for row in table]
    with atomic_write(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_mot(path: Path) -> tuple[dict[str, F64], F64]:
    """Read a MOT or STO file.

    Returns:
        The columns by name, each (T,), angles in degrees whatever the file has, and the time (T,) s.

    Raises:
        RecordingError: the header has no end, there is no column `time`, or a row of another width.
    """
    lines = _text(path).splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None or end + 1 >= len(lines):
        raise RecordingError("not a MOT file: no line says endheader", where=str(path))
    names = lines[end + 1].split()
    if "time" not in names:
        raise RecordingError("no column 'time'", where=f"{path}:{end + 2}", hint=f"the columns are: {', '.join(names)}")
    rows = [
        row_of_numbers(line.split(), len(names), f"{path}:{number}")
        for number, line in enumerate(lines[end + 2 :], end + 3)
        if line.strip()
    ]
    table = dict(zip(names, np.array(rows).reshape(-1, len(names)).T.copy(), strict=True))
    time = table.pop("time")
    if any(line.replace(" ", "").lower() == "indegrees=no" for line in lines[:end]):
        table = {name: column if name.endswith(SHIFTS) else np.degrees(column) for name, column in table.items()}
    return table, time


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
    return names, _seen(positions), (first + np.arange(len(positions))) / rate, rate


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


def _seen(positions: F64) -> F64:
    """Return marker positions (T, K, 3) with NaN where all three are zero, as many programs write what is not seen."""
    return np.where((positions == 0).all(axis=-1, keepdims=True), np.nan, positions)


def _text(path: Path) -> str:
    if not path.is_file():
        raise RecordingError("no such file", where=str(path))
    return path.read_text(encoding="utf-8-sig", errors="replace")


def _fitted(cells: Sequence[str], width: int) -> Sequence[str]:
    """Return the cells of a row of which trailing empty ones may be too many or left out."""
    kept = len(cells)
    while kept > width and not cells[kept - 1].strip():
        kept -= 1
    return [*cells[:kept], *[""] * (width - kept)]
