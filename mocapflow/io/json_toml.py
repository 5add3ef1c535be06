"""Files that people type, JSON and TOML: what is wrong in them is told by line and column."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

from mocapflow.errors import RecordingError

PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")  # behind what tomllib says


def read_json(path: Path, hint: str = "") -> Any:
    """Return what a JSON file holds.

    Args:
        path: the file.
        hint: how to go on where it can't be read.

    Raises:
        RecordingError: it can't be opened, is not JSON, or says something twice; with the place.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        for key, count in Counter(key for key, _ in pairs).items():
            if count > 1:  # json itself would take the last one in silence
                raise RecordingError(f"'{key}' is there more than once", where=place(path, key), hint=hint)
        return dict(pairs)

    try:
        return json.loads(_text(path, hint), object_pairs_hook=once)
    except json.JSONDecodeError as error:
        where = f"{path}:{error.lineno}:{error.colno}"
        raise RecordingError(f"not JSON: {error.msg}", where=where, hint=hint) from None
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, a thousand brackets
        raise RecordingError(f"this JSON can't be read: {error}", where=str(path), hint=hint) from None


def read_toml(path: Path, hint: str = "") -> dict[str, Any]:
    """Return what a TOML file holds; see `read_json`."""
    try:
        return tomllib.loads(_text(path, hint))
    except tomllib.TOMLDecodeError as error:
        what, *place = PLACE.split(str(error))
        where = ":".join([str(path), *filter(None, place)])
        raise RecordingError(f"not TOML: {what}", where=where, hint=hint) from None


def place(path: Path, name: str) -> str:
    """Return where a name is first written in a file, as file:line:column; the file alone where it is not."""
    word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError):
        return str(path)
    found = ((number, match) for number, line in enumerate(lines, 1) if (match := word.search(line)))
    return next((f"{path}:{number}:{match.start() + 1}" for number, match in found), str(path))


def _text(path: Path, hint: str) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors put a byte order mark before the text
    except OSError as error:
        raise RecordingError(f"can't be read: {error.strerror}", where=str(path), hint=hint) from None
    except UnicodeDecodeError:
        raise RecordingError("is not UTF-8 text", where=str(path), hint=hint) from None
