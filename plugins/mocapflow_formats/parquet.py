"""Parquet: the columns of angles.csv, for tables that outgrow text."""

from __future__ import annotations

from pathlib import Path

from mocapflow_sequence import tables

from mocapflow.geometry import angles
from mocapflow_formats.result import Result, library


def write(result: Result, path: Path) -> None:
    """Write frame, time and every angle with its standard deviation; degrees."""
    track = result.track
    series = angles.measure(result.scene.body, track.root, track.angles, track.covariance)
    table = library("pyarrow", "parquet").table({**tables.angle_columns(track, series), "frame": track.frame})
    library("pyarrow.parquet", "parquet").write_table(table, path)
