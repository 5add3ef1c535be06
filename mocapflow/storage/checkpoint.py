"""A track that grows frame by frame on disk and goes on where it stopped.

Frames are rows of the arrays of `growing`; `Checkpoint.track` writes them out as the named arrays of `Track`. A frame
counts once `frames_done` says so, which is written last and in one step, when the rest is on the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from mocapflow.data import (
    NO_CLOTH,
    REMEMBERED,
    Cloth,
    Frame,
    FrameResult,
    FrameState,
    Moment,
    Past,
    Pose,
    Turn,
)
from mocapflow.interrupts import check
from mocapflow.io.atomic import forget_parts
from mocapflow.records import F64, silent
from mocapflow.results import Track
from mocapflow.storage import packing
from mocapflow.storage.artifacts import Artifact, writing
from mocapflow.storage.growing import CLOTH, NUMBERS, Growing
from mocapflow.storage.locks import Lock
from mocapflow.storage.packing import column
from mocapflow.storage.rows import group_meta, write_json
from mocapflow.storage.sealing import seal
from mocapflow.storage.store import Store


class Rest(NamedTuple):
    """How the loop of a frame has ended."""

    frame: int  # its index
    turns: int
    steady: bool  # it came to rest


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
        self._indices = indices
        self._attributes: dict[str, Any] = dict(artifact.attributes)
        self._wanted, self._fresh, self._cap = wanted, fresh, 0
        self._turns: list[Pose] | None = None  # of the frame at hand
        self._earlier, self._said = artifact.warnings, list[str]()
        self._iteration_done, self._frame_done = iteration_done, frame_done
        self._growing = Growing(artifact.path, indices, cameras)
        forget_parts(artifact.path)  # of a commit that was cut off; zarr would complain of them

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
        moments = tuple(self._moment(self._growing.numbers(row, self._columns), self._cloth(row)) for row in rows)
        return Past(moments=moments, appearance=self._appearance(self.done - 1) if rows else {})

    def rests(self) -> Iterator[Rest]:
        """Yield how each frame that is saved has ended."""
        for row in range(self.done):
            numbers = self._growing.numbers(row, self._columns)
            turns, steady = (float(column(self._columns, numbers, name)) for name in ("iterations", "steady"))
            yield Rest(self._indices[row], int(turns), bool(steady))

    def keep_turns(self, cap: int) -> None:
        """Keep the pose of every turn as `trace`, at most `cap` a frame; frames that are done have none."""
        self._turns, self._cap = [], cap

    def observe(self, frame: int, turn: Turn, state: FrameState) -> None:
        """Tell onlookers about one turn of the loop."""
        if self._turns is not None:
            self._turns.append(state.estimate.pose)
        self._iteration_done(frame, turn.index, state)

    def commit(self, frame: Frame, past: Past, result: FrameResult) -> Past:
        """Save a frame and return the past of the next: arrays first, the count of frames last.

        Raises:
            StoreError: the store is full or can't be written; the frames before this one are saved.
            RecordingError: what the frames are made from has changed since the run began.
        """
        check()  # whether somebody wants to stop
        state, row = result.state, self.done
        appearance = _copies(state.segmentation.appearance or past.appearance)
        if self._lock is not None:
            self._lock.check()
        self._store.digests.check_inputs()
        with writing(self._store.path, self.kept):
            numbers = self._write_row(row, frame, result)
            self._growing.write_appearance(row, appearance)
            news = {
                "notes": self._notes(frame.index, result.notes), "warnings": self.warnings,
                "appearance": [[name, list(values.shape)] for name, values in appearance.items()],
                "frames_done": row + 1, "complete": False,
            }  # fmt: skip
            write_json(self._path / "zarr.json", group_meta(self._attributes | news))
        self._attributes |= news
        self._frame_done(frame.index, result)
        return past.after(self._moment(numbers, _copy(state.cloth.vertices)), appearance)

    def _write_row(self, row: int, frame: Frame, result: FrameResult) -> F64:
        """Write a frame, all but its appearance, and return its numbers."""
        state = result.state
        if not row:
            self._lay_out(frame, result)
        numbers = packing.row_of(self._columns, frame, result, self._attributes["step_names"])
        self._growing.write_numbers(row, numbers)
        if len(state.cloth.vertices):
            self._growing.write_cloth(row, state.cloth.vertices)
        self._growing.write_seen(row, state.segmentation.silhouettes, state.matches)
        if self._turns is not None:
            self._growing.write_trace(row, self._turns, self._cap, len(state.estimate.pose.angles))
            self._turns.clear()
        return numbers

    def track(self) -> Track:
        """Return the frames so far, sealed as named arrays.

        Raises:
            StoreError: they can't be written or read back.
        """
        with writing(self._store.path, self.kept):
            rows = self._growing.array(NUMBERS)
            if self._attributes["cloth_vertices"]:
                self._growing.array(CLOTH).resize(self.done)
            self._growing.flush()
            told = self._attributes | {"warnings": self.warnings}
            self._attributes = seal(self._path, told, rows, self._columns, self._indices[: self.done])
        track: Track = self._store.load(Artifact(self._path, self._attributes), self._wanted or self.done)
        return track

    @cached_property
    def _columns(self) -> packing.Columns:
        return {name: tuple(shape) for name, shape in self._attributes["columns"]}

    def _lay_out(self, frame: Frame, result: FrameResult) -> None:
        columns = packing.columns_of(frame, result)
        self._attributes["columns"] = [[name, list(shape)] for name, shape in columns.items()]
        self._attributes["step_names"] = list(result.seconds)
        self._attributes["energy_terms"] = list(result.energy_terms)
        self._attributes["cloth_vertices"] = len(result.state.cloth.vertices)

    def _moment(self, numbers: F64, vertices: F64) -> Moment:
        value = partial(column, self._columns, numbers)
        pose = Pose(root=value("root"), angles=value("angles"))
        cloth = Cloth(vertices=vertices, parameters=value("cloth_parameters"))
        return Moment(time=float(value("time")), pose=pose, cloth=cloth, observed=value("observed"))

    def _cloth(self, row: int) -> F64:
        return self._growing.cloth(row) if self._attributes["cloth_vertices"] else _copy(NO_CLOTH.vertices)

    def _appearance(self, row: int) -> dict[str, F64]:
        return self._growing.appearance(row, {name: tuple(shape) for name, shape in self._attributes["appearance"]})

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


def _copy(values: npt.NDArray[Any]) -> F64:
    """Return values in fresh memory, laid out as they are when read back: sums then round the same way."""
    return np.array(values, np.float64, order="C")


def _copies(appearance: Mapping[str, F64]) -> dict[str, F64]:
    return {name: _copy(values) for name, values in appearance.items()}
