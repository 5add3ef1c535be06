"""Parquet: the columns of angles.csv, for tables that outgrow text."""

from __future__ import annotations

from pathlib import Path

from mocapflow.geometry import angles
from mocapflow_formats.result import Result, library


def write(result: Result, path: Path) -> None:
    """Write frame, time and every angle with its standard deviation; degrees."""
    track = result.track
    series = angles.measure(result.scene.body, track.root, track.angles, track.covariance)
    columns = {"frame": track.frame, "time": track.time}
    for index, name in enumerate(series.names):
        columns |= {name: series.value[:, index], f"{name}_sd": series.sd[:, index]}
    table = library("pyarrow", "parquet").table(columns)
    library("pyarrow.parquet", "parquet").write_table(table, path)
