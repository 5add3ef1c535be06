"""Pictures of other moments, without keeping more than one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mocapflow.data import Frame
from mocapflow.recordings.recording import Recording


class SequentialReader:
    """The pictures of one camera, wound forward as they are asked for: one at a time is held."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._coming: Iterator[Frame] = iter(())
        self._now: Frame | None = None

    def at(self, index: int) -> Frame:
        """Return a frame by its number; going back starts over."""
        if self._now is None or index < self._now.index:
            self._coming = replace(self._recording, indices=range(index, self._recording.length)).frames()
            self._now = next(self._coming)
        while self._now.index < index:
            self._now = next(self._coming)
        return self._now
