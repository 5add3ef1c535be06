"""One writer per artifact: a lock file with pid, host and heartbeat."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mocapflow.errors import StoreError

BEAT = 5.0  # s between heartbeats
DEAD = 60.0  # s without a heartbeat after which a writer on another machine counts as gone
GUARD = "guard"  # the file beside the locks that `_guard` locks
POLL = 0.2  # s between looks at a lock that another run holds


class Lock:
    """A lock that was acquired; `check` before each write notices that another run took it over."""

    def __init__(self, path: Path, said: str, name: str) -> None:
        self._path, self._said, self._name = path, said, name
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._beat, name=f"heartbeat of {path.name}", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise if the lock is no longer ours.

        Raises:
            StoreError: another run took it over, because this one gave no sign of life, or the store is gone.
        """
        if not self._path.parent.exists():
            hint = "somebody removed or moved it while this run went on"
            raise StoreError(f"the store {self._path.parents[1]} is gone", hint=hint)
        if not self._ours():
            hint = "this run stood still for too long; without --fresh the same command continues from what is saved"
            raise StoreError(f"another run took over {self._name}", hint=hint)

    def release(self) -> None:
        """Give the lock back."""
        self._done.set()
        self._thread.join()
        with suppress(FileNotFoundError), _guard(self._path.parent):  # the store may be gone
            if self._ours():
                self._path.unlink()

    def _ours(self) -> bool:
        try:
            return self._path.read_text() == self._said
        except OSError:
            return False

    def _beat(self) -> None:
        while not self._done.wait(BEAT):
            if self._ours():  # else `check` tells, before the next write
                with suppress(OSError):
                    os.utime(self._path)


def acquire(path: Path, name: str, report: Callable[[str], None]) -> Lock:
    """Wait until nobody else writes, then return the lock; `name` is what people call the thing locked."""
    told = False
    said = json.dumps({**myself(), "token": uuid.uuid4().hex})
    while True:
        with _guard(path.parent):
            holder = _holder(path)
            if holder is None:
                return _taken(path, said, name)
            if _stale(path, holder):
                report(f"{name}: taking over from {who(holder)}, which ended without finishing")
                path.unlink(missing_ok=True)
                return _taken(path, said, name)
        if not told:
            report(f"{name}: waiting for {who(holder)}, which is making it")
            told = True
        time.sleep(POLL)


def _taken(path: Path, said: str, name: str) -> Lock:
    """Return a lock that nobody holds, taken."""
    try:
        path.write_text(said)
    except OSError:  # the drive is full: nobody holds it
        path.unlink(missing_ok=True)
        raise
    return Lock(path, said, name)


@contextmanager
def looking(path: Path) -> Iterator[bool]:
    """Give whether somebody holds a lock; as long as it is looked at, nobody new does.

    Who ended without giving it back does not hold it.
    """
    with _guard(path.parent):
        holder = _holder(path)
        yield holder is not None and not _stale(path, holder)


@contextmanager
def _guard(folder: Path) -> Iterator[None]:
    """Let one process at a time look at the locks and change them."""
    with (folder / GUARD).open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _holder(path: Path) -> dict[str, Any] | None:
    try:
        holder = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except ValueError:
        return {}
    return holder if isinstance(holder, dict) else {}


def _stale(path: Path, holder: dict[str, Any]) -> bool:
    ended = gone(holder)
    return _now(path.parent) - path.stat().st_mtime > DEAD if ended is None else ended


def _now(folder: Path) -> float:
    """Return the time in s by the clock that heartbeats go by: that of the drive, which may be another machine's."""
    os.utime(folder / GUARD)
    return (folder / GUARD).stat().st_mtime


def myself() -> dict[str, Any]:
    """Return who this process is, as others can ask after it."""
    return {"pid": os.getpid(), "host": socket.gethostname(), "space": _space(), "born": _born(os.getpid())}


def gone(process: Mapping[str, Any]) -> bool | None:
    """Return whether a process has ended, None where it can't be told: it is on another machine, or in a container."""
    pid, here = process.get("pid"), (socket.gethostname(), _space())
    if (process.get("host"), process.get("space", _space())) != here or not isinstance(pid, int):
        return None
    return not _alive(pid) or _born(pid) not in {"", process.get("born")}


def _alive(pid: int) -> bool:
    try:
        with suppress(PermissionError):  # it is somebody else's
            os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _space() -> str:
    """Return within which container, of those on one machine, a pid is a process; "" if unknown."""
    try:
        return os.readlink("/proc/self/ns/pid")
    except OSError:
        return ""


def _born(pid: int) -> str:
    """Return when a process started, so that a pid used again is not mistaken for its first owner; "" if unknown."""
    try:
        state, *rest = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return "Z" if state == "Z" else rest[18]


def who(process: Mapping[str, Any] | None) -> str:
    """Return a process in words."""
    process = process or {}
    return f"process {process.get('pid', '?')} on {process.get('host', '?')}"
