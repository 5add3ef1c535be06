"""Tables of numbers as csv: a header line, then one row per frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from mocapflow.geometry.angles import AngleSeries
from mocapflow.io.atomic import atomic_write
from mocapflow.records import F64
from mocapflow.results import Track


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
    with atomic_write(path) as part:
        np.savetxt(part, rows, fmt=styles, delimiter=",", header=",".join(columns), comments="")
    return path


def write_rows(path: Path, rows: Sequence[Mapping[str, float | str]]) -> Path:
    """Write one line per mapping, four decimals; the keys of the first are the header."""
    with atomic_write(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if rows:
            writer.writerow(rows[0])
        for row in rows:
            writer.writerow([f"{v:.4f}" if isinstance(v, float) else v for v in row.values()])
    return path
