"""Zarr arrays of whole rows to a chunk, mostly one frame each, written and read without zarr's event loop.

A write through zarr's own interface costs 1.1 ms of CPU however small it is, the same chunk written here 0.1 ms
(benchmarks/store_commit.py). The files are plain zarr v3: bytes, then zstd level 1 with its checksum.

What a resumed run reads is on the drive when the call returns, for a machine may lose its power. For the four files of
a frame that takes 1.5 ms of waiting, 15 while others write (there).
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numcodecs.zstd import Zstd

from mocapflow.errors import StoreError
from mocapflow.io.atomic import atomic_write

LEVEL = 1


class Corrupted(StoreError):
    """An artifact that can't be read back; it is set aside and made anew."""


class Rows:
    """One array of shape (T, ...); zarr reads what was never written as `fill`.

    Rows are read and replaced where each is a chunk of its own; a sealed array is only created.
    """

    def __init__(self, path: Path) -> None:
        meta = read_json(path / "zarr.json")
        try:
            self.shape: tuple[int, ...] = tuple(meta["shape"])
            self._chunk = tuple(meta["chunk_grid"]["configuration"]["chunk_shape"])
            self._fill = float(meta["fill_value"])
            self._dtype: np.dtype[Any] = np.dtype(meta["data_type"])
        except (KeyError, TypeError, ValueError) as error:
            raise Corrupted(f"{path} is no array of frames: {error!r}") from error
        self._path, self._meta = path, meta
        self._zstd = Zstd(level=LEVEL, checksum=True)
        self._inner = ".0" * len(self.shape[1:])

    @classmethod
    def create(
        cls,
        path: Path,
        shape: Sequence[int],
        dtype: str,
        fill: float,
        axes: Sequence[str],
        attributes: dict[str, Any],
        block: int = 1,
    ) -> Rows:
        """Return a new array with `block` rows to a chunk; an older one in its place is replaced."""
        path.mkdir(exist_ok=True)
        for old in path.glob("c.*"):
            old.unlink()
        chunk = [block, *(max(1, n) for n in shape[1:])]
        write_json(path / "zarr.json", array_meta(shape, chunk, np.dtype(dtype), fill, axes, attributes))
        return cls(path)

    def resize(self, frames: int) -> None:
        """Say how many rows there are; what was written stays."""
        if frames != self.shape[0]:
            self.shape = (frames, *self.shape[1:])
            self._meta["shape"] = list(self.shape)
            write_json(self._path / "zarr.json", self._meta)

    def write(self, row: int, values: npt.NDArray[Any], *, durable: bool = True) -> None:
        """Write one row of an array with one row to a chunk; not durable: somebody flushes it later."""
        self.write_block(row, values[None], durable=durable)

    def write_block(self, block: int, values: npt.NDArray[Any], *, durable: bool = True) -> None:
        """Write a chunk: as many rows as it has, or fewer at the end of the array."""
        assert values.shape[1:] == self.shape[1:] and len(values) <= self._chunk[0], (values.shape, self._chunk)
        if not values.size:
            return
        full = np.ascontiguousarray(values, self._dtype)
        if len(values) < self._chunk[0]:  # zarr keeps whole chunks
            full = np.full(self._chunk, self._fill, self._dtype)
            full[: len(values)] = values
        file = self._file(block)
        file.write_bytes(self._zstd.encode(full))
        if durable:
            flush(file)

    def read(self, row: int) -> npt.NDArray[Any]:
        """Return one row, freshly allocated.

        Raises:
            Corrupted: it was never written, or can't be read back.
        """
        shape = self.shape[1:]
        if 0 in shape:
            return np.empty(shape, self._dtype)
        try:
            values = np.frombuffer(self._zstd.decode(self._file(row).read_bytes()), self._dtype)
            return values.reshape(shape).copy()  # never shorter than the row, as decoding into one leaves it unnoticed
        except FileNotFoundError as error:
            raise Corrupted(f"row {row} of {self._path} is missing") from error
        except (RuntimeError, ValueError) as error:
            raise Corrupted(f"row {row} of {self._path} is damaged: {error}") from error

    def _file(self, row: int) -> Path:
        return self._path / f"c.{row}{self._inner}"


def array_meta(
    shape: Sequence[int],
    chunk: Sequence[int],
    dtype: np.dtype[Any],
    fill: float,
    axes: Sequence[str],
    attributes: dict[str, Any],
) -> dict[str, Any]:
    """Return the metadata of a zarr v3 array; the files of its chunks lie side by side, without folders."""
    value: Any = "NaN" if np.isnan(fill) else bool(fill) if dtype.kind == "b" else int(fill)
    return {
        "zarr_format": 3, "node_type": "array", "shape": list(shape), "data_type": dtype.name, "fill_value": value,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(chunk)}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
        "codecs": [
            {"name": "bytes", "configuration": {"endian": "little"}} if dtype.itemsize > 1 else {"name": "bytes"},
            {"name": "zstd", "configuration": {"level": LEVEL, "checksum": True}},
        ],
        "dimension_names": list(axes), "attributes": attributes, "storage_transformers": [],
    }  # fmt: skip


def group_meta(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the metadata of a zarr group."""
    return {"attributes": attributes, "zarr_format": 3, "node_type": "group"}


def read_json(path: Path) -> dict[str, Any]:
    """Return the metadata of a zarr node."""
    try:
        meta = json.loads(path.read_bytes())
    except FileNotFoundError as error:
        raise Corrupted(f"{path} is missing") from error
    except ValueError as error:
        raise Corrupted(f"{path} is damaged: {error}") from error
    if not isinstance(meta, dict):
        raise Corrupted(f"{path} is damaged")
    return meta


def write_json(path: Path, value: Any) -> None:
    """Replace the metadata of a zarr node in one step."""
    with atomic_write(path) as part:
        part.write_text(json.dumps(value, separators=(",", ":")))  # no letter but ASCII: any locale can write it
        flush(part)


def flush(path: Path) -> None:
    """Wait until a file is on the drive."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def flush_all(folder: Path) -> None:
    """Wait until all files in a folder are on the drive."""
    for path in filter(Path.is_file, folder.rglob("*")):
        flush(path)
