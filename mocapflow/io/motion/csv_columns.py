"""Tables of numbers as csv, column by column: a header line, then one row per frame."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from mocapflow.errors import RecordingError
from mocapflow.io.motion.rows import row_of_numbers
from mocapflow.records import F64

DIVIDERS = {";": "semicolons", "\t": "tabs"}  # that spreadsheets write in place of commas
FORM = "expected UTF-8 text, commas between the columns, a point in a number"


def read_columns(path: Path) -> dict[str, F64]:
    """Read a table of numbers; empty cells are NaN.

    Raises:
        RecordingError: the file is missing or no UTF-8 text, two columns have one name, or a row has other cells than
            the header or a cell is no number.
    """
    if not path.is_file():
        raise RecordingError("no such table", where=str(path))
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, row) for row in reader if row]
    except UnicodeDecodeError:
        raise RecordingError("is not UTF-8 text", where=str(path), hint=FORM) from None
    except csv.Error as error:
        raise RecordingError(f"is no table: {error}", where=f"{path}:{reader.line_num}", hint=FORM) from None
    if len(lines) < 2:
        raise RecordingError("the table has no rows", where=str(path))
    header = [name.strip() for name in lines[0][1]]
    if len(header) == 1 and (divided := next((name for sign, name in DIVIDERS.items() if sign in header[0]), "")):
        raise RecordingError(f"the columns are divided by {divided}", where=f"{path}:1", hint=FORM)
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise RecordingError(f"two columns are called '{twice}'", where=f"{path}:1", hint="which one is meant?")
    values = np.array([row_of_numbers(row, len(header), f"{path}:{number}") for number, row in lines[1:]])
    return {name: values[:, column].copy() for column, name in enumerate(header)}
