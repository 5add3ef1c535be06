"""The rows of tables that are text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError


def read_text(path: Path) -> str:
    """Return what a file says, with any byte that is no UTF-8 replaced.

    Raises:
        RecordingError: there is no such file.
    """
    if not path.is_file():
        raise RecordingError("no such file", where=str(path))
    return path.read_text(encoding="utf-8-sig", errors="replace")


def row_of_numbers(cells: Sequence[str], width: int, where: str) -> list[float]:
    """Return the numbers in the cells of a row; an empty cell is NaN.

    Raises:
        RecordingError: there are more or fewer cells than columns, or one holds no number; `where` is the row's place.
    """
    if len(cells) != width:
        raise RecordingError(f"{len(cells)} columns; expected {width}", where=where)
    return [_number(cell, f"{where}:{column}") if cell.strip() else np.nan for column, cell in enumerate(cells, 1)]


def _number(cell: str, where: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise RecordingError(f"'{cell.strip()}' is no number", where=where) from None
