"""Paths as OpenCV takes them, names that look alike, and links that lead nowhere."""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path

from mocapflow.errors import MocapflowError


def for_opencv(path: Path) -> str:
    """Return a path that OpenCV and ffmpeg can open: absolute, for they take the `take:` of `take:1` for a protocol.

    Raises:
        MocapflowError: the path is not UTF-8, at which OpenCV kills the process.
    """
    text = os.path.abspath(path)
    try:
        text.encode()
    except UnicodeEncodeError:
        where = text.encode("utf-8", "backslashreplace").decode()
        hint = "rename the file or folder, or set a UTF-8 locale (LC_ALL=C.UTF-8)"
        raise MocapflowError("this path holds bytes that are no UTF-8", where=where, hint=hint) from None
    return text


def composed(name: str) -> str:
    """Return a name with each letter as one character: macOS writes `ü` in file names as `u` and two dots."""
    return unicodedata.normalize("NFC", name)


def led_nowhere(path: Path) -> str:
    """Return what to say of a link to something that is not there, "" of any other path."""
    return f"it is a link to {path.readlink()}, where nothing is" if path.is_symlink() and not path.exists() else ""
