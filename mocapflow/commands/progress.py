"""Progress on stderr: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import TextIO

COUNT = re.compile(r"^(\S+): (\d+) of (\d+) (frames.*)$")
WIDTH = 30


def reporter(stream: TextIO | None = None) -> Callable[[str], None]:
    """Return a function that shows lines of progress."""
    out = stream or sys.stderr
    return _Bar(out).show if out.isatty() else lambda line: print(line, file=out, flush=True)


class _Bar:
    """Draws counts of frames in place and writes other lines below one another."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._open = out, False

    def show(self, line: str) -> None:
        counted = COUNT.match(line)
        if counted is None:
            self._out.write(("\n" if self._open else "") + line + "\n")
            self._open = False
        else:
            label, done, total, rest = counted[1], int(counted[2]), int(counted[3]), counted[4]
            full = WIDTH * done // max(total, 1)
            self._out.write(f"\r\x1b[K{label}: {'█' * full}{'·' * (WIDTH - full)} {done} of {total} {rest}")
            self._open = done < total
            self._out.write("" if self._open else "\n")
        self._out.flush()
