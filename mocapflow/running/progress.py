"""Tells now and then how far a stage is and how long the rest will take."""

from __future__ import annotations

import time
from collections.abc import Callable

BEAT = 2.0  # s between lines


class Progress:
    """Counts the frames of one stage.

    Args:
        label: of the stage.
        report: told the lines.
        brief: say nothing of what is done before the first line is due.
    """

    def __init__(self, label: str, report: Callable[[str], None], *, brief: bool = False) -> None:
        self._label, self._report, self._silent = label, report, brief
        self._last = time.monotonic()
        self._first: tuple[int, float] | None = None

    def tell(self, done: int, of: int, news: str = "") -> None:
        """Count a frame; tell if the last line is some time ago, or it is the last frame."""
        now = time.monotonic()
        if self._first is None or done <= self._first[0]:  # the first frame loads what the others have
            self._first = done, now
        due = now - self._last >= BEAT
        if due or (done == of and not self._silent):
            self._last, self._silent = now, False
            start, since = self._first
            left = f"{clock((now - since) / (done - start) * (of - done))} left" if start < done < of else ""
            self._report(", ".join(filter(None, [f"{self._label}: {done} of {of} frames", left, news])))


def clock(seconds: float) -> str:
    """Return a time as people read it: 0:09, 12:30, 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
