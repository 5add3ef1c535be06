"""Every error a user can meet: what happened, where, and how to go on."""

from __future__ import annotations

import errno
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

FULL = frozenset({errno.ENOSPC, errno.EDQUOT})  # errors of a full drive
MOST = 30  # names that a hint lists


class MocapflowError(Exception):
    """A problem the user can mend; the command line prints it without a traceback.

    Args:
        message: what is wrong, in one sentence.
        where: the place, as `file:line:column` or `file`.
        hint: what exists instead, or how to go on.
    """

    exit_status = 2

    def __init__(self, message: str, *, where: str = "", hint: str = "") -> None:
        self.message, self.where, self.hint = message, where, hint
        super().__init__(str(self))

    def __str__(self) -> str:
        head = f"{self.where}  {self.message}" if self.where else self.message
        return "\n".join([head, *(f"       {line}" for line in self.hint.splitlines())])


class PipelineError(MocapflowError):
    """The pipeline file does not say what it should."""


class PluginError(MocapflowError):
    """A plugin does not keep to its role."""


class UnknownComponent(PipelineError):
    """The pipeline names a component that no plugin provides."""


class ShapeError(MocapflowError):
    """An array has the wrong shape or kind."""


class GarmentError(MocapflowError):
    """A garment can't be sewn from these measures."""


class RecordingError(MocapflowError):
    """A recording folder is incomplete or contradicts itself."""


class StoreError(MocapflowError):
    """The store can't be read or written."""

    exit_status = 1


def folder_error(error: OSError) -> type[MocapflowError]:
    """Return the class of error for a folder that can't be made or written: wrong input where a file has its name."""
    return MocapflowError if isinstance(error, FileExistsError | NotADirectoryError) else StoreError


def no_run_folder(out: Path, error: OSError) -> MocapflowError:
    """Return the error for a run folder that can't be made or written."""
    hint = f"name another folder, or {'free some space' if error.errno in FULL else 'make it writable'}"
    return folder_error(error)(f"can't write the run folder: {error.strerror}", where=str(out), hint=hint)


def unwritable(error: OSError) -> StoreError | None:
    """Return the error for a full drive, or a file that may not be written or read; None for other causes."""
    if error.errno not in {*FULL, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM} or not error.strerror:
        return None
    hint = "free some space, then run the same command" if error.errno in FULL else ""
    what = "can't be written or read" if error.filename else "a file can't be written or read"
    return StoreError(f"{what}: {error.strerror}", where=str(error.filename or ""), hint=hint)


def uncompilable(error: BaseException) -> MocapflowError | None:
    """Return the error to tell where numba finds no place for compiled code; None for other causes."""
    if not isinstance(error, RuntimeError) or "no locator available" not in str(error):
        return None
    hint = "NUMBA_CACHE_DIR names a folder of yours for it"
    return MocapflowError("compiled code can be kept neither beside its source nor in a home folder", hint=hint)


def raised(error: BaseException) -> str:
    """Return in one line what foreign code has raised."""
    if isinstance(error, MocapflowError):
        return error.message
    if isinstance(error, SystemExit):
        return f"it left with status {error.code}"
    first = " ".join(str(error).strip().partition("\n\n")[0].splitlines())  # pydantic adds an address behind it
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


class ComponentFailed(MocapflowError):
    """A component raised while a run was going on."""

    exit_status = 1


class Noted(str):
    """A note on an error: when in a run it was raised."""


@contextmanager
def noting(moment: str) -> Iterator[None]:
    """Note on whatever is raised in here when it was; of several notes the first is the nearest."""
    try:
        yield
    except BaseException as error:
        error.add_note(Noted(moment))
        raise


def moment_of(error: BaseException) -> str:
    """Return when in a run an error was raised, "" where nobody has noted it."""
    return next((note for note in getattr(error, "__notes__", ()) if isinstance(note, Noted)), "")


def alternatives(wanted: str, available: Iterable[str]) -> str:
    """Return the hint `available: a, b — did you mean 'a'?` for a name that is not there."""
    names = sorted(available)
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return " — ".join(filter(None, [f"available: {', '.join(names[:MOST]) or 'none'}{more}", guess(wanted, names)]))


def guess(wanted: str, available: Collection[str]) -> str:
    """Return `did you mean 'a'?`, or nothing where no name is like the one that is wanted."""
    close = get_close_matches(wanted, available, n=1)
    return f"did you mean '{close[0]}'?" if close else ""
