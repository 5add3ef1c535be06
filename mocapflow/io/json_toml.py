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


def place(path: Path, name: str, entry: int = 0) -> str:
    """Return where a name is first written in a file, as file:line:column; the file alone where it is not.

    Args:
        path: the file.
        name: what is looked for.
        entry: where the file is a list of plain objects, in which of them.
    """
    word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return str(path)
    opened = [match.start() for match in re.finditer(r"\{", text)]
    found = word.search(text, opened[entry] if 0 < entry < len(opened) else 0)
    if found is None:
        return str(path)
    line, column = text.count("\n", 0, found.start()), found.start() - text.rfind("\n", 0, found.start())
    return f"{path}:{line + 1}:{column}"


def _text(path: Path, hint: str) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors put a byte order mark before the text
    except OSError as error:
        raise RecordingError(f"can't be read: {error.strerror}", where=str(path), hint=hint) from None
    except UnicodeDecodeError:
        raise RecordingError("is not UTF-8 text", where=str(path), hint=hint) from None
