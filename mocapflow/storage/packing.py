"""One frame as numbers: which go into its row, and how silhouettes and matches are stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import prod

import numba
import numpy as np
import numpy.typing as npt

from mocapflow.data import Frame, FrameResult, Matches, Silhouette
from mocapflow.records import F32, F64
from mocapflow.results import values_of

FINE = 8  # steps per px of a stored silhouette
UNSEEN = -128  # stored where a view has no silhouette
MATCH = ("camera", "x px", "y px", "direction x", "direction y", "vertex", "weight px^-2")
UNITS = {  # of the columns that `Track` does not have
    "body_change": "m, largest move of a body vertex in the last turn",
    "cloth_change": "m, root mean square move of the cloth in the last turn",
    "angle_change": "rad, largest change of an angle in the last turn",
    "match_count": "1, rows of the frame in matches/ that are no padding",
}

Columns = Mapping[str, tuple[int, ...]]  # name -> shape, in the order of the row


def columns_of(frame: Frame, result: FrameResult) -> Columns:
    """Return the layout of a row for frames and results of this size."""
    return {name: np.shape(value) for name, value in values_of(frame, result, list(result.seconds)).items()}


def row_of(columns: Columns, frame: Frame, result: FrameResult, steps: Sequence[str]) -> F64:
    """Return all numbers of a frame as one row (N,), column after column."""
    values = values_of(frame, result, steps)
    parts = [np.asarray(values[name], float) for name in columns]
    for part, (name, shape) in zip(parts, columns.items(), strict=True):
        if part.shape != shape:
            raise ValueError(f"{name} of frame {frame.index} has shape {part.shape}; the frames before had {shape}")
    return np.concatenate([part.ravel() for part in parts])


def spans(columns: Columns) -> dict[str, slice]:
    """Return where each column lies in the row."""
    ends = np.cumsum([prod(shape) for shape in columns.values()]).tolist()
    return {name: slice(end - prod(columns[name]), end) for name, end in zip(columns, ends, strict=True)}


def column(columns: Columns, rows: F64, name: str) -> F64:
    """Return one column of a row (N,) or of rows (T, N), in its own shape and its own memory."""
    values = rows[..., spans(columns)[name]]
    return values.reshape((*rows.shape[:-1], *columns[name])).copy()


def quantised(silhouette: Silhouette) -> npt.NDArray[np.int8]:
    """Return a signed distance in steps of 1/8 px; the mask `distance > 0` stays as it is."""
    steps = np.empty(silhouette.distance.shape, np.int8)
    _quantise(silhouette.distance, steps)
    return steps


@numba.njit(cache=True)
def _quantise(distance, steps):  # type: ignore[no-untyped-def]
    fine, half, most = np.float32(FINE), np.float32(0.5), np.float32(127)
    for row in range(distance.shape[0]):
        for column in range(distance.shape[1]):
            value = min(max(distance[row, column] * fine, -most), most)
            nearest = np.int32(np.floor(value + half))
            steps[row, column] = nearest + np.int32((value > 0) & (nearest < 1))  # without branches it vectorises


def match_row(matches: Matches) -> F32:
    """Return matches as float32 (capacity, 7), padded with zeros: the capacity is a power of two."""
    count = len(matches.weight)
    capacity = max(64, 1 << (count - 1).bit_length())
    packed = np.zeros((capacity, len(MATCH)), np.float32)
    used = packed[:count]
    used[:, 0], used[:, 5], used[:, 6] = matches.camera, matches.vertex, matches.weight
    used[:, 1:3], used[:, 3:5] = matches.pixel, matches.direction
    return packed
