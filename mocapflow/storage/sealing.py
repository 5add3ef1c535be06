"""The rows of a finished track written out as named arrays, for `Store.load` and for xarray."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.records import array_fields
from mocapflow.results import Track
from mocapflow.series import BLOCK
from mocapflow.storage.archive import PLAIN, axis_names
from mocapflow.storage.packing import UNITS, Columns, column
from mocapflow.storage.rows import Corrupted, Rows, group_meta, write_json


def seal(
    path: Path, attributes: dict[str, Any], rows: Rows, columns: Columns, indices: Sequence[int]
) -> dict[str, Any]:
    """Write every column of the rows as an array of its own and return the attributes of the sealed group."""
    sealed = int(attributes.get("sealed", 0))
    arrays = {name: _array(path, name, shape, len(indices), sealed) for name, shape in columns.items()}
    for block in range(sealed // BLOCK, -(-len(indices) // BLOCK)):
        part = indices[block * BLOCK : (block + 1) * BLOCK]
        values = np.stack([rows.read(block * BLOCK + row) for row in range(len(part))])
        if not np.array_equal(column(columns, values, "frame"), part):
            raise Corrupted(f"frames are missing in {path}")
        for name, array in arrays.items():
            array.write_block(block, column(columns, values, name))
    if not attributes["cloth_vertices"]:
        _array(path, "cloth", (0, 3), len(indices), sealed)
    names = {name: attributes[name] for name in ("step_names", "energy_terms")}
    plain = names | {"notes": told(attributes.get("notes", []), indices)}
    record = {"record": f"{Track.__module__}:{Track.__qualname__}", PLAIN: plain}
    attributes = {**attributes, **record, "sealed": len(indices), "complete": True}
    write_json(path / "zarr.json", group_meta(attributes))
    return attributes


def told(notes: Sequence[tuple[int, int, str]], indices: Sequence[int]) -> list[str]:
    """Return one line per note and frame, in the order of the frames, whose indices ascend."""
    frames = (indices[bisect_left(indices, first) : bisect_right(indices, last)] for first, last, _ in notes)
    spread = [(index, note) for (_, _, note), on in zip(notes, frames, strict=True) for index in on]
    return [f"frame {index}: {note}" for index, note in sorted(spread, key=lambda told: told[0])]


def _array(path: Path, name: str, shape: tuple[int, ...], rows: int, sealed: int) -> Rows:
    """Return the array of a column, made at the first sealing and lengthened at later ones."""
    if sealed:
        made = Rows(path / name)
        made.resize(rows)
        return made
    declared = array_fields(Track).get(name)
    axes = axis_names(name, declared.axes if declared else ("T",), 1 + len(shape))
    dtype = declared.dtype if declared else np.dtype(float)
    unit = declared.unit if declared else UNITS[name]
    return Rows.create(path / name, (rows, *shape), dtype.name, 0, axes, {"unit": unit}, BLOCK)
