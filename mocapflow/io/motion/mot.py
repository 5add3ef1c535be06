"""OpenSim's motion files, MOT and STO."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.atomic import atomic_write
from mocapflow.io.motion.rows import read_text, row_of_numbers
from mocapflow.records import F64

SHIFTS = ("_tx", "_ty", "_tz")  # OpenSim's names of coordinates that are lengths, not angles


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
    lines = read_text(path).splitlines()
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
    if any("".join(line.split()).lower() == "indegrees=no" for line in lines[:end]):
        table = {name: column if name.endswith(SHIFTS) else np.degrees(column) for name, column in table.items()}
    return table, time
