"""A track that grows frame by frame on disk and goes on where it stopped.

Layout of its group: `live/rows` holds all numbers of a frame in one row of float64, `cloth` one chunk per frame,
`silhouettes/<layer>/<camera>` int8 at 1/8 px, `matches/<capacity>` one padded row per frame, `trace` the poses of a
frame's turns where they are kept, and `live/appearance-<size>` the last two appearances in turns, each behind the
number of its frame. `Checkpoint.track` writes the rows out as the named arrays of `Track`. A frame counts once
`frames_done` says so, which is written last and in one step, when the rest is on the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mocapflow import packing
from mocapflow.data import (
    NO_CLOTH,
    REMEMBERED,
    Cloth,
    Frame,
    FrameResult,
    FrameState,
    Matches,
    Moment,
    Past,
    Pose,
    Silhouette,
    Turn,
)
from mocapflow.locks import Lock
from mocapflow.packing import column
from mocapflow.records import F64
from mocapflow.results import Track
from mocapflow.rows import Corrupted, Rows, write_json
from mocapflow.sealing import seal
from mocapflow.store import Artifact, Store, group_meta, writing


def silent(*_: Any) -> None:
    """Tell nobody."""


class Checkpoint:
    """Keeps and finds the frames of one track.

    Args:
        store: where its artifact lies.
        artifact: the group, new or half done.
        indices: the frames to track, as indices into the videos.
        cameras: their names.
        lock: the right to write; checked before each frame.
        wanted: how many frames `track` returns; None: all that are done.
        fresh: True where the same command would make all anew.
        iteration_done: told (frame, iteration, state) after each turn of the loop.
        frame_done: told (frame, result) after each commit.
    """

    def __init__(
        self,
        store: Store,
        artifact: Artifact,
        indices: Sequence[int],
        cameras: Sequence[str],
        lock: Lock | None = None,
        *,
        wanted: int | None = None,
        fresh: bool = False,
        iteration_done: Callable[[int, int, FrameState], None] = silent,
        frame_done: Callable[[int, FrameResult], None] = silent,
    ) -> None:
        self._store, self._path, self._lock = store, artifact.path, lock
        self._indices, self._cameras = indices, tuple(cameras)
        self._attributes: dict[str, Any] = dict(artifact.attributes)
        self._wanted, self._fresh, self._cap = wanted, fresh, 0
        self._turns: list[Pose] | None = None  # of the frame at hand
        self._earlier, self._said = artifact.warnings, list[str]()
        self._iteration_done, self._frame_done = iteration_done, frame_done
        self._arrays: dict[str, Rows] = {}

    @property
    def done(self) -> int:
        """How many frames are committed."""
        return int(self._attributes.get("frames_done", 0))

    @property
    def next_index(self) -> int:
        """The frame to go on with; past the last one when all are done."""
        return self._indices[self.done] if self.done < len(self._indices) else self._indices[-1] + 1

    @property
    def kept(self) -> str:
        """Which frames are saved and how to go on, for people."""
        if not self.done:
            return "no frame is saved yet; run the same command to start again"
        first, last = self._indices[0], self._indices[self.done - 1]
        again = "run the same command without --fresh" if self._fresh else "run the same command"
        return f"frames {first}–{last} are saved; {again} to continue at {self.next_index}"

    @property
    def warnings(self) -> list[str]:
        """What was warned of in all runs that made the frames, each once."""
        return list(dict.fromkeys([*self._earlier, *self._said]))

    def keep_warnings(self, said: list[str]) -> None:
        """Keep with the frames what this run warns of: a list that grows meanwhile."""
        self._said = said

    def past(self) -> Past:
        """Return what the next frame may know of earlier ones, bit by bit as it was."""
        rows = range(max(0, self.done - REMEMBERED), self.done)
        moments = tuple(self._moment(self._row(row), self._cloth(row)) for row in rows)
        return Past(moments=moments, appearance=self._appearance(self.done - 1) if rows else {})

    def keep_turns(self, cap: int) -> None:
        """Keep the pose of every turn as `trace`, at most `cap` a frame; frames that are done have none."""
        self._turns, self._cap = [], cap

    def observe(self, frame: int, turn: Turn, state: FrameState) -> None:
        """Tell onlookers about one turn of the loop."""
        if self._turns is not None:
            self._turns.append(state.estimate.pose)
        self._iteration_done(frame, turn.index, state)

    def commit(self, frame: Frame, past: Past, result: FrameResult, notes: Sequence[str] = ()) -> Past:
        """Save a frame and return the past of the next: arrays first, the count of frames last.

        Raises:
            StoreError: the store is full or can't be written; the frames before this one are saved.
        """
        state, row = result.state, self.done
        appearance = _plain(state.segmentation.appearance or past.appearance)
        if self._lock is not None:
            self._lock.check()
        with writing(self._store.path, self.kept):
            if not row:
                self._lay_out(result)
            numbers = packing.row_of(self._columns, frame, result, self._attributes["step_names"])
            self._rows("live/rows", numbers, np.nan, "number").write(row, numbers)
            if len(state.cloth.vertices):
                self._rows("cloth", state.cloth.vertices, np.nan, "W", "cloth_2", unit="m").write(
                    row, state.cloth.vertices
                )
            self._write_seen(row, state.segmentation.silhouettes, state.matches)
            self._write_appearance(row, frame.index, appearance)
            self._write_trace(row)
            news = {
                "notes": self._notes(frame.index, notes), "warnings": self.warnings,
                "frames_done": row + 1, "complete": False,
            }  # fmt: skip
            write_json(self._path / "zarr.json", group_meta(self._attributes | news))
        self._attributes |= news
        self._frame_done(frame.index, result)
        return past.after(self._moment(numbers, _copy(state.cloth.vertices)), appearance)

    def track(self) -> Track:
        """Return the frames so far, sealed as named arrays.

        Raises:
            StoreError: they can't be written or read back.
        """
        with writing(self._store.path, self.kept):
            rows = self._open("live/rows")
            if self._attributes["cloth_vertices"]:
                self._open("cloth").resize(self.done)
            told = self._attributes | {"warnings": self.warnings}
            self._attributes = seal(self._path, told, rows, self._columns, self._indices[: self.done])
        track: Track = self._store.load(Artifact(self._path, self._attributes), self._wanted or self.done)
        return track

    def seen(self, row: int) -> tuple[tuple[Silhouette, ...], Matches]:
        """Return the stored silhouettes and matches of a committed row."""
        count = int(column(self._columns, self._row(row), "match_count"))
        packed = self._open(f"matches/{packing.match_capacity(count)}").read(row)
        found = []
        for folder in sorted((self._path / "silhouettes").glob("*/*/zarr.json")):
            layer, camera = folder.parent.parent.name, folder.parent.name
            kept = self._open(f"silhouettes/{layer}/{camera}")
            if kept.has(row):
                distance = packing.distance_of(kept.read(row))
                found.append(Silhouette(camera=self._cameras.index(camera), layer=layer, distance=distance))
        return tuple(found), packing.matches_of(packed, count)

    @cached_property
    def _columns(self) -> packing.Columns:
        return {name: tuple(shape) for name, shape in self._attributes["columns"]}

    def _lay_out(self, result: FrameResult) -> None:
        columns = packing.columns_of(result, len(self._cameras))
        self._attributes["columns"] = [[name, list(shape)] for name, shape in columns.items()]
        self._attributes["step_names"] = list(result.seconds)
        self._attributes["energy_terms"] = list(result.energy_terms)
        self._attributes["cloth_vertices"] = len(result.state.cloth.vertices)

    def _write_seen(self, row: int, silhouettes: Sequence[Silhouette], matches: Matches) -> None:
        for silhouette in silhouettes:
            name = f"silhouettes/{silhouette.layer}/{self._cameras[silhouette.camera]}"
            steps = packing.quantised(silhouette)
            self._rows(name, steps, packing.UNSEEN, "y", "x", unit=f"1/{packing.FINE} px").write(row, steps)
        packed = packing.match_row(matches)
        name = f"matches/{len(packed)}"
        self._rows(name, packed, 0, f"M{len(packed)}", "match", columns=packing.MATCH).write(row, packed)

    def _write_appearance(self, row: int, index: int, appearance: Mapping[str, F64]) -> None:
        self._attributes["appearance"] = [[name, list(values.shape)] for name, values in appearance.items()]
        if appearance:
            flat = np.concatenate([[index], *(values.ravel() for values in appearance.values())])
            self._rows(f"live/appearance-{len(flat)}", flat, np.nan, f"A{len(flat)}").write(row % 2, flat)

    def _appearance(self, row: int) -> dict[str, F64]:
        shapes = {name: tuple(shape) for name, shape in self._attributes["appearance"]}
        if not shapes:
            return {}
        size = sum(prod(shape) for shape in shapes.values())
        frame, flat = np.split(self._open(f"live/appearance-{1 + size}").read(row % 2), [1])
        if frame != self._indices[row]:
            raise Corrupted(f"the appearance of frame {self._indices[row]} is missing in {self._path}")
        return {name: column(shapes, flat, name) for name in shapes}

    def _moment(self, numbers: F64, cloth: F64) -> Moment:
        pose = Pose(root=column(self._columns, numbers, "root"), angles=column(self._columns, numbers, "angles"))
        parameters = column(self._columns, numbers, "cloth_parameters")
        time = float(column(self._columns, numbers, "time"))
        observed = column(self._columns, numbers, "observed")
        return Moment(time=time, pose=pose, cloth=Cloth(vertices=cloth, parameters=parameters), observed=observed)

    def _row(self, row: int) -> F64:
        numbers = self._open("live/rows").read(row)
        if column(self._columns, numbers, "frame") != self._indices[row]:
            raise Corrupted(f"frame {self._indices[row]} is missing in {self._path}")
        return numbers

    def _cloth(self, row: int) -> F64:
        return self._open("cloth").read(row) if self._attributes["cloth_vertices"] else _copy(NO_CLOTH.vertices)

    def _notes(self, index: int, notes: Sequence[str]) -> list[list[Any]]:
        """Return all notes; one that goes on from the frame before is lengthened, so that they stay few."""
        told: list[list[Any]] = [[*note] for note in self._attributes.get("notes", [])]
        before = self._indices[self.done - 1] if self.done else None
        for note in notes:
            same = next((old for old in told if old[1] == before and old[2] == note), None)
            if same is not None:
                same[1] = index
            else:
                told.append([index, index, note])
        return told

    def _write_trace(self, row: int) -> None:
        if self._turns is None:
            return
        turns = np.full((self._cap, 16 + self._columns["angles"][0]), np.nan)
        for turn, pose in enumerate(self._turns):
            turns[turn] = np.concatenate([pose.root.ravel(), pose.angles])
        self._rows("trace", turns, np.nan, "turn", "root_and_angles").write(row, turns)
        self._turns.clear()

    def _rows(self, name: str, like: npt.NDArray[Any], fill: float, *axes: str, **attributes: Any) -> Rows:
        """Return the array that holds rows like this one, made on first use."""
        if name not in self._arrays and not (self._path / name / "zarr.json").exists():
            for parent in reversed(Path(name).parents[:-1]):
                if not (self._path / parent / "zarr.json").exists():
                    (self._path / parent).mkdir(exist_ok=True)
                    write_json(self._path / parent / "zarr.json", group_meta({}))
            shape = (len(self._indices), *like.shape)
            Rows.create(self._path / name, shape, like.dtype.name, fill, ("T", *axes), attributes)
        return self._open(name)

    def _open(self, name: str) -> Rows:
        if name not in self._arrays:
            self._arrays[name] = Rows(self._path / name)
            self._arrays[name].resize(max(len(self._indices), self._arrays[name].shape[0]))
        return self._arrays[name]


def _copy(values: npt.NDArray[Any]) -> F64:
    """Return values in fresh memory, laid out as they are when read back: sums then round the same way."""
    return np.array(values, np.float64, order="C")


def _plain(appearance: Mapping[str, F64]) -> dict[str, F64]:
    return {name: _copy(values) for name, values in appearance.items()}
