"""The arrays of a track while it grows, one row of each for a frame.

`live/rows` holds all numbers of a frame in one row of float64, `cloth` one chunk per frame, `matches/<capacity>` one
padded row per frame, `silhouettes/<layer>/<camera>` int8 at 1/8 px, `trace` the poses of a frame's turns where they are
kept, and `live/appearance-<size>` the last two appearances in turns, each behind the number of its frame.

A resumed run does not read what was seen (`SEEN`): that is flushed to the drive when the track is finished, all else
at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mocapflow.data import Matches, Pose, Silhouette
from mocapflow.records import F64
from mocapflow.storage import packing
from mocapflow.storage.packing import Columns, column
from mocapflow.storage.rows import Corrupted, Rows, flush_all, group_meta, write_json

NUMBERS, CLOTH, TRACE = "live/rows", "cloth", "trace"
SEEN = ("silhouettes", "matches", TRACE)
Shapes = Mapping[str, tuple[int, ...]]


class Growing:
    """Writes and reads rows of the arrays of a group; each array is made when its first row is written.

    Args:
        path: of the group.
        indices: of all frames that are wanted.
        cameras: their names.
    """

    def __init__(self, path: Path, indices: Sequence[int], cameras: Sequence[str]) -> None:
        self._path, self._indices, self._cameras = path, indices, tuple(cameras)
        self._arrays: dict[str, Rows] = {}

    def numbers(self, row: int, columns: Columns) -> F64:
        """Return the numbers of a frame.

        Raises:
            Corrupted: they are missing or damaged.
        """
        numbers = self.array(NUMBERS).read(row)
        if column(columns, numbers, "frame") != self._indices[row]:
            raise Corrupted(f"frame {self._indices[row]} is missing in {self._path}")
        return numbers

    def write_numbers(self, row: int, numbers: F64) -> None:
        """Write all numbers of a frame."""
        self._rows_for(NUMBERS, numbers, np.nan, "number", unit="by column: `columns` of the track").write(row, numbers)

    def cloth(self, row: int) -> F64:
        """Return the cloth vertices (W, 3) m of a frame."""
        return self.array(CLOTH).read(row)

    def write_cloth(self, row: int, vertices: F64) -> None:
        """Write the cloth vertices (W, 3) m of a frame."""
        self._rows_for(CLOTH, vertices, np.nan, "W", "cloth_2", unit="m").write(row, vertices)

    def write_seen(self, row: int, silhouettes: Sequence[Silhouette], matches: Matches) -> None:
        """Write what was found in the images of a frame."""
        for silhouette in silhouettes:
            name = f"silhouettes/{silhouette.layer}/{self._cameras[silhouette.camera]}"
            steps = packing.quantised(silhouette)
            seen = self._rows_for(name, steps, packing.UNSEEN, "y", "x", unit=f"1/{packing.FINE} px")
            seen.write(row, steps, durable=False)
        packed = packing.match_row(matches)
        name = f"matches/{len(packed)}"
        about = {"unit": "by column", "columns": packing.MATCH}
        self._rows_for(name, packed, 0, f"M{len(packed)}", "match", **about).write(row, packed, durable=False)

    def appearance(self, row: int, shapes: Shapes) -> dict[str, F64]:
        """Return what frames have shown up to this one, one of the last two.

        Raises:
            Corrupted: it is missing or damaged.
        """
        if not shapes:
            return {}
        size = sum(prod(shape) for shape in shapes.values())
        frame, flat = np.split(self.array(f"live/appearance-{1 + size}").read(row % 2), [1])
        if frame != self._indices[row]:
            raise Corrupted(f"the appearance of frame {self._indices[row]} is missing in {self._path}")
        return {name: column(shapes, flat, name) for name in shapes}

    def write_appearance(self, row: int, appearance: Mapping[str, F64]) -> None:
        """Write what frames have shown up to this one, over that of the last but one."""
        if appearance:
            flat = np.concatenate([[self._indices[row]], *(values.ravel() for values in appearance.values())])
            name, unit = f"live/appearance-{len(flat)}", "frame index, then as the segmenter has it"
            self._rows_for(name, flat, np.nan, f"A{len(flat)}", unit=unit).write(row % 2, flat)

    def write_trace(self, row: int, turns: Sequence[Pose], cap: int, angles: int) -> None:
        """Write the poses of a frame's turns, at most `cap`, with so many angles each."""
        poses = np.full((cap, 16 + angles), np.nan)
        for turn, pose in enumerate(turns):
            poses[turn] = np.concatenate([pose.root.ravel(), pose.angles])
        unit = "root (4, 4) in m, world_from_body, then angles in rad; NaN after the last turn"
        self._rows_for(TRACE, poses, np.nan, "turn", "root_and_angles", unit=unit).write(row, poses, durable=False)

    def flush(self) -> None:
        """Wait until what was not flushed when it was written is on the drive."""
        for name in SEEN:
            flush_all(self._path / name)

    def array(self, name: str) -> Rows:
        """Return an array that is there."""
        if name not in self._arrays:
            self._arrays[name] = Rows(self._path / name)
            self._arrays[name].resize(max(len(self._indices), self._arrays[name].shape[0]))
        return self._arrays[name]

    def _rows_for(self, name: str, row: npt.NDArray[Any], fill: float, *axes: str, **attributes: Any) -> Rows:
        """Return the array that holds rows like this one, made on first use."""
        if name not in self._arrays and not (self._path / name / "zarr.json").exists():
            for parent in reversed(Path(name).parents[:-1]):
                if not (self._path / parent / "zarr.json").exists():
                    (self._path / parent).mkdir(exist_ok=True)
                    write_json(self._path / parent / "zarr.json", group_meta({}))
            shape = (len(self._indices), *row.shape)
            Rows.create(self._path / name, shape, row.dtype.name, fill, ("T", *axes), attributes)
        return self.array(name)
