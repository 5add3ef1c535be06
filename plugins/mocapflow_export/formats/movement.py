"""NetCDF that the `movement` toolbox and xarray read: joint centres with names, times and units."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mocapflow_export.formats.result import Result, library


def write(result: Result, path: Path) -> None:
    """Write a poses dataset: position (time, space, keypoints, individuals) m, and a confidence."""
    library("h5netcdf", "movement")
    places = np.moveaxis(result.places, 1, 2)[..., None]
    seen = np.mean(result.track.usable, axis=1)[:, None, None]  # share of the cameras that saw the frame
    dimensions = ("time", "space", "keypoints", "individuals")
    dataset = library("xarray", "movement").Dataset(
        {
            "position": (dimensions, places, {"units": "m"}),
            "confidence": (("time", "keypoints", "individuals"), np.broadcast_to(seen, (*places.shape[::2], 1)).copy()),
        },
        coords={
            "time": result.track.time,
            "space": ["x", "y", "z"],
            "keypoints": list(result.scene.body.joint_names),
            "individuals": ["person"],
        },
        attrs={
            "ds_type": "poses",
            "fps": result.recording.run_rate,
            "time_unit": "seconds",
            "source_software": "mocapflow",
        },
    )
    dataset.to_netcdf(path, engine="h5netcdf")
