"""Tracks in the files of other programs: one writer a module; each imports its library only when it writes."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from mocapflow.io.atomic import atomic_write
from mocapflow_export.formats.result import Result, lacking

__all__ = ["FILES", "Result", "need_packages", "write"]
FILES: Mapping[str, str] = {  # format, which is the module's name: its file in results/
    "bvh": "motion.bvh",
    "c3d": "joints.c3d",
    "gltf": "scene.glb",
    "movement": "poses.nc",
    "parquet": "angles.parquet",
    "rrd": "scene.rrd",
    "usd": "scene.usdc",
}
PACKAGES: Mapping[str, tuple[str, ...]] = {  # that a format is written with; others need none
    "c3d": ("ezc3d",),
    "gltf": ("pygltflib",),
    "movement": ("h5netcdf", "xarray"),
    "parquet": ("pyarrow",),
    "rrd": ("rerun",),
    "usd": ("pxr",),
}
EXTRAS: Mapping[str, str] = {"rrd": "view"}  # of mocapflow, that brings them, where it has not the format's name


def need_packages(name: str) -> None:
    """Check that a format can be written.

    Raises:
        PipelineError: a package that it needs is not installed.
    """
    for package in PACKAGES.get(name, ()):
        if find_spec(package) is None:
            raise lacking(package, EXTRAS.get(name, name))


def write(name: str, result: Result, folder: Path) -> Path:
    """Write a result in one of the formats into a folder and return the path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILES[name]
    with atomic_write(path) as part:
        import_module(f"mocapflow_export.formats.{name}").write(result, part)
    return path
