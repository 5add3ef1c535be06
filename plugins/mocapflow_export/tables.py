"""Tables of numbers as csv: a header line, then one row per frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.geometry.angles import AngleSeries
from mocapflow.io.markers import numbers
from mocapflow.records import F64
from mocapflow.results import Track

FORM = "expected UTF-8 text, commas between the columns, a point in a number"


def angle_columns(track: Track, series: AngleSeries) -> dict[str, F64]:
    """Return the columns of angles.csv: frame, time, every angle followed by its deviation, then what was seen."""
    columns = {"frame": track.frame.astype(np.float64), "time": track.time}
    for column, name in enumerate(series.names):
        columns[name] = series.value[:, column]
        columns[f"{name}_sd"] = series.sd[:, column]
    observed = {f"{name}_observed": series.observed[:, column] for column, name in enumerate(series.names)}
    return columns | observed


def angle_names(columns: Iterable[str]) -> list[str]:
    """Return which columns of angles.csv are angles."""
    return [name for name in columns if name not in ("frame", "time") and not name.endswith(("_sd", "_observed"))]


def energy_columns(track: Track) -> dict[str, F64]:
    """Return the columns of energy.csv, one row per frame and turn: frame, turn, then every term of the functional."""
    row, turn = np.nonzero(np.isfinite(track.energy).any(axis=2))
    terms = dict(zip(track.energy_terms, track.energy[row, turn].T, strict=True))
    return {"frame": track.frame[row].astype(np.float64), "turn": turn.astype(np.float64), **terms}


def write_columns(path: Path, columns: Mapping[str, F64]) -> Path:
    """Write columns (T,) with four decimals; frames and turns are whole numbers, times have six decimals."""
    formats = {"frame": "%d", "turn": "%d", "time": "%.6f"}
    styles = [formats.get(name, "%.4f") for name in columns]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt=styles, delimiter=",", header=",".join(columns), comments="")
    return path


def read_columns(path: Path) -> dict[str, F64]:
    """Read a table of numbers; empty cells are NaN.

    Raises:
        RecordingError: the file is missing or no UTF-8 text, two columns have one name, or a row has other cells than
            the header or a cell is no number.
    """
    if not path.is_file():
        raise RecordingError("no such table", where=str(path))
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except UnicodeDecodeError:
        raise RecordingError("is not UTF-8 text", where=str(path), hint=FORM) from None
    if len(rows) < 2:
        raise RecordingError("the table has no rows", where=str(path))
    header = [name.strip() for name in rows[0]]
    if len(header) == 1 and ";" in header[0]:
        raise RecordingError("the columns are divided by semicolons", where=f"{path}:1", hint=FORM)
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise RecordingError(f"two columns are called '{twice}'", where=f"{path}:1", hint="which one is meant?")
    values = np.array([numbers(row, len(header), f"{path}:{number}") for number, row in enumerate(rows[1:], 2)])
    return {name: values[:, column].copy() for column, name in enumerate(header)}


def write_rows(path: Path, rows: Sequence[Mapping[str, float | str]]) -> Path:
    """Write one line per mapping, four decimals; the keys of the first are the header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if rows:
            writer.writerow(rows[0])
        for row in rows:
            writer.writerow([f"{v:.4f}" if isinstance(v, float) else v for v in row.values()])
    return path
