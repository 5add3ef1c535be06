"""Parquet: the columns of angles.csv, for tables that outgrow text."""

from __future__ import annotations

from pathlib import Path

from mocapflow_export import tables
from mocapflow_export.formats.result import Result, library
from mocapflow_export.uncertainty import measured


def write(result: Result, path: Path) -> None:
    """Write frame, time, and of every angle value, standard deviation (degrees) and observed share."""
    track = result.track
    series = measured(track, result.scene)
    table = library("pyarrow", "parquet").table({**tables.angle_columns(track, series), "frame": track.frame})
    library("pyarrow.parquet", "parquet").write_table(table, path)
