"""Files that are there as a whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

PART = ".part-"  # begins the name of what is not whole yet


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a path to write to, in whose file's place a file comes in one step when all of it is written.

    A reader sees the old file or the new one, never a part, whatever ends the writer. Each writer has a path of its
    own, with the ending of the file's: some libraries go by it.
    """
    part = path.with_name(f"{PART}{uuid4().hex}{path.suffix}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        if error.filename == str(part) or (error.errno and error.filename is None):  # a full drive tells no name
            error.filename = str(path)  # by which people know the file
        raise
    finally:
        with suppress(OSError):  # a drive that can't be written does not say that there is nothing to remove
            part.unlink()


def forget_parts(folder: Path) -> None:
    """Remove what writers left in a folder that were killed; nobody may be writing there."""
    for part in folder.glob(f"{PART}*"):
        part.unlink(missing_ok=True)
