"""The rows of a finished track written out as named arrays, for `Store.load` and for xarray."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import ZstdCodec

from mocapflow.archive import PLAIN, axis_names
from mocapflow.data import Track
from mocapflow.packing import Columns, column
from mocapflow.records import array_fields
from mocapflow.rows import Corrupted, Rows, write_json
from mocapflow.store import group_meta

BLOCK = 64  # rows per chunk, and in memory at a time


def seal(
    path: Path, attributes: dict[str, Any], rows: Rows, columns: Columns, indices: Sequence[int]
) -> dict[str, Any]:
    """Write every column of the rows as an array of its own and return the attributes of the sealed group."""
    sealed = int(attributes.get("sealed", 0))
    group = zarr.open_group(str(path), mode="r+")
    arrays = {name: _array(group, name, shape, len(indices)) for name, shape in columns.items()}
    for first in range(sealed - sealed % BLOCK, len(indices), BLOCK):
        block = np.stack([rows.read(row) for row in range(first, min(first + BLOCK, len(indices)))])
        if not np.array_equal(column(columns, block, "frame"), indices[first : first + BLOCK]):
            raise Corrupted(f"frames are missing in {path}")
        for name, array in arrays.items():
            if array.size:
                array[first : first + len(block)] = column(columns, block, name).astype(array.dtype)
    if not attributes["cloth_vertices"]:
        _array(group, "cloth", (0, 3), len(indices))
    plain = {"step_names": attributes["step_names"], "notes": told(attributes.get("notes", []), indices)}
    record = {"record": f"{Track.__module__}:{Track.__qualname__}", PLAIN: plain}
    attributes = {**attributes, **record, "sealed": len(indices), "complete": True}
    write_json(path / "zarr.json", group_meta(attributes))
    return attributes


def told(notes: Sequence[tuple[int, int, str]], indices: Sequence[int]) -> list[str]:
    """Return one line per note and frame, in the order of the frames."""
    spread = [(index, note) for first, last, note in notes for index in indices if first <= index <= last]
    return [f"frame {index}: {note}" for index, note in sorted(spread, key=lambda told: told[0])]


def _array(group: zarr.Group, name: str, shape: tuple[int, ...], rows: int) -> Any:
    if name in group:
        made: Any = group[name]
        if made.shape[0] != rows:
            made.resize((rows, *shape))
        return made
    declared = array_fields(Track).get(name)
    axes = axis_names(name, declared.axes if declared else ("T",), 1 + len(shape))
    dtype = declared.dtype if declared and declared.dtype else np.dtype(float)
    return group.create_array(
        name, shape=(rows, *shape), chunks=(BLOCK, *(max(1, n) for n in shape)), dtype=dtype, dimension_names=axes,
        compressors=[ZstdCodec(level=1, checksum=True)], attributes={"unit": declared.unit} if declared else {},
    )  # fmt: skip
