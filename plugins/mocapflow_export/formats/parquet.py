"""Parquet: the columns of angles.csv, for tables that outgrow text."""

from __future__ import annotations

from pathlib import Path

from mocapflow_export import tables
from mocapflow_export.formats.result import Result, library


def write(result: Result, path: Path) -> None:
    """Write frame, time, and of every angle value, standard deviation (degrees) and observed share."""
    columns = tables.angle_columns(result.track, result.angles)
    table = library("pyarrow", "parquet").table({**columns, "frame": result.track.frame})
    library("pyarrow.parquet", "parquet").write_table(table, path)
