"""CPU time of the steps of a frame."""

from __future__ import annotations

import time


class Stopwatch:
    """Adds up CPU seconds by name: each lap counts from the one before."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.process_time()

    def lap(self, name: str) -> None:
        """Count the time since the last lap under a name."""
        now = time.process_time()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now
