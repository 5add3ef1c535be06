"""Progress on stderr: a bar on a terminal, plain lines elsewhere; the last line also in the run folder."""

from __future__ import annotations

import json
import logging
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from mocapflow.io.atomic import atomic_write

FILE = "progress.json"
COUNT = re.compile(r"^(\S+): (\d+) of (\d+) (frames.*)$")
WIDTH = 30


@contextmanager
def reporter(stream: TextIO | None = None) -> Iterator[Callable[[str], None]]:
    """Give a function that shows lines of progress; what is written afterwards begins on a line of its own."""
    out = stream or sys.stderr
    if not out.isatty():
        yield lambda line: print(line, file=out, flush=True)
        return
    bar = _Bar(out)
    handlers = [*logging.getLogger().handlers, *logging.getLogger("mocapflow").handlers]
    for handler in handlers:
        handler.addFilter(bar.make_way)
    try:
        yield bar.show
    finally:
        for handler in handlers:
            handler.removeFilter(bar.make_way)
        bar.close()


@contextmanager
def noted(report: Callable[[str], None], folder: Path) -> Iterator[Callable[[str], None]]:
    """Give a reporter that also keeps its last line in the run folder as long as the run goes on."""
    from mocapflow.storage.locks import myself

    path = folder / FILE

    def show(line: str) -> None:
        with suppress(OSError), atomic_write(path) as part:  # a full disk is for the store to tell
            part.write_text(json.dumps({**myself(), "at": time.time(), "said": line}), encoding="utf-8")
        report(line)

    try:
        yield show
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def last_word(folder: Path) -> str:
    """Return what the run that is going on in a folder has told last, "" if there is none."""
    from mocapflow.running.progress import clock
    from mocapflow.storage.locks import gone, who

    try:
        note = json.loads((folder / FILE).read_text(encoding="utf-8"))
        ago, said, ended = clock(max(0.0, time.time() - note["at"])), note["said"], gone(note)
    except (OSError, ValueError, LookupError, TypeError):
        return ""
    if ended:
        return f"{who(note)} ended without finishing; run the same command to go on"
    return f"{who(note)}, {ago} ago: {said}"


class _Bar:
    """Draws counts of frames in place and writes other lines below one another."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._open = out, False

    def show(self, line: str) -> None:
        counted = COUNT.match(line)
        if counted is None:
            self.close()
            self._out.write(line + "\n")
        else:
            label, done, total, rest = counted[1], int(counted[2]), int(counted[3]), counted[4]
            full = WIDTH * done // max(total, 1)
            text = f"{label}: {'█' * full}{'·' * (WIDTH - full)} {done} of {total} {rest}"
            # one that wraps would not be overwritten
            self._out.write("\r\x1b[K" + text[: shutil.get_terminal_size().columns - 1])
            self._open = done < total
            self._out.write("" if self._open else "\n")
        self._out.flush()

    def make_way(self, _: logging.LogRecord) -> bool:
        """End the line before something is logged; as a filter of handlers it lets all of that pass."""
        self.close()
        return True

    def close(self) -> None:
        """End the line of a count that has not come to its end."""
        self._out.write("\n" if self._open else "")
        self._open = False
