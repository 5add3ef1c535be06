"""Arrays that are too large for memory over a whole recording: rows are made when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.intp]
BLOCK = 64  # rows in memory at a time, and in a chunk of the store


class Series:
    """An array (T, ...) of float64 that is indexed along its first axis as any other: by row, slice, numbers or mask.

    Args:
        shape: (T, ...).
        rows: returns the values (K, ...) of the row numbers (K,).
    """

    dtype: ClassVar[np.dtype[np.float64]] = np.dtype(np.float64)

    def __init__(self, shape: tuple[int, ...], rows: Callable[[Numbers], Values]) -> None:
        self.shape, self._rows = shape, rows

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, which: Any) -> Values:
        first, *others = which if isinstance(which, tuple) else (which,)
        if first is Ellipsis:
            first, others = slice(None), [Ellipsis, *others]
        numbers = np.arange(len(self))[first]
        values = self._rows(np.atleast_1d(numbers))
        return values[(slice(None) if np.ndim(numbers) else 0, *others)]

    def __iter__(self) -> Iterator[Values]:
        for part in blocks(len(self)):
            yield from self[part]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.asarray(self[:], dtype)


Wide = Values | Series


def blocks(count: int) -> list[slice]:
    """Return slices that cover so many rows, each a chunk of the store."""
    return [slice(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK)]


def changed(series: Wide, change: Callable[[Values, Numbers], Values]) -> Series:
    """Return a series of the same shape whose rows are made of those of another.

    Args:
        series: (T, ...).
        change: returns what becomes of the rows (K, ...) with the numbers (K,).
    """
    return Series(series.shape, lambda numbers: change(series[numbers], numbers))


def picked(series: Wide, rows: npt.NDArray[Any]) -> Wide:
    """Return some rows, by number or mask; those of a series are made when they are asked for."""
    if isinstance(series, np.ndarray):
        return np.asarray(series[rows])
    kept = np.arange(len(series))[rows]
    return Series((len(kept), *series.shape[1:]), lambda numbers: series[kept[numbers]])


def overwritten(series: Wide, rows: Mapping[int, Values]) -> Wide:
    """Return a series with other values in some rows, by their numbers."""

    def change(values: npt.NDArray[Any], numbers: Numbers) -> npt.NDArray[Any]:
        values = values.copy()
        for place, number in enumerate(numbers.tolist()):
            if number in rows:
                values[place] = rows[number]
        return values

    return change(series, np.arange(len(series))) if isinstance(series, np.ndarray) else changed(series, change)


def joined(first: Wide, second: Wide) -> Series:
    """Return the rows of two, one after the other."""

    def rows(numbers: Numbers) -> Values:
        values, early = np.empty((len(numbers), *first.shape[1:])), numbers < len(first)
        values[early], values[~early] = first[numbers[early]], second[numbers[~early] - len(first)]
        return values

    return Series((len(first) + len(second), *first.shape[1:]), rows)
