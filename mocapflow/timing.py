"""CPU time of the steps of a frame."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence


class Stopwatch:
    """Adds up CPU seconds by name: each lap counts from the one before.

    Args:
        names: the laps there are; the ones that are never run count 0.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.seconds = dict.fromkeys(names, 0.0)
        self._last = time.process_time()

    def lap(self, name: str) -> None:
        """Count the time since the last lap under a name."""
        now = time.process_time()
        self.seconds[name] += now - self._last
        self._last = now

    def take(self, seconds: Mapping[str, float]) -> None:
        """Count the laps of another watch as those since the last lap."""
        for name, spent in seconds.items():
            self.seconds[name] += spent
        self._last = time.process_time()
