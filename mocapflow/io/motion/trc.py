"""OpenSim's marker files, TRC."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.atomic import atomic_write
from mocapflow.io.motion.rows import read_text, row_of_numbers
from mocapflow.records import F64

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


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
    lines = read_text(path).splitlines()
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
        row_of_numbers(_cells(line, width), width, f"{path}:{number}")
        for number, line in enumerate(lines[5:], 6)
        if line.strip()
    ]
    table = np.array(rows).reshape(-1, width)
    positions = seen(table[:, 2:].reshape(-1, len(names), 3) * METRES[unit])
    return names, positions, table[:, 1].copy(), rate


def seen(positions: F64) -> F64:
    """Return marker positions (T, K, 3) with NaN where all three are zero, as many programs write what is not seen."""
    return np.where((positions == 0).all(axis=-1, keepdims=True), np.nan, positions)


def _cells(line: str, width: int) -> Sequence[str]:
    """Return the cells of a row of which trailing empty ones may be too many or left out."""
    cells = line.rstrip().split("\t")
    return [*cells, *[""] * (width - len(cells))]
