"""Ctrl-C and SIGTERM: compiled code may swallow what they raise, or make another error of it."""

from __future__ import annotations

import signal
from types import FrameType

HEARD = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """What to do at a signal: raise as Python does, and remember it."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt."""
        self.asked = True
        raise KeyboardInterrupt

    def install(self) -> None:
        """Listen to Ctrl-C, and to SIGTERM, a scheduler's way of saying it; in the background Ctrl-C stays ignored."""
        for number in HEARD:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self)


def check() -> None:
    """Raise KeyboardInterrupt if a signal has asked for it and compiled code has swallowed it."""
    if _asked():
        raise KeyboardInterrupt


def interrupted(error: BaseException | None) -> bool:
    """True where Ctrl-C is behind an error: compiled code that it falls into raises one of its own."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return _asked()


def _asked() -> bool:
    handlers = (signal.getsignal(number) for number in HEARD)
    return any(isinstance(handler, Interrupts) and handler.asked for handler in handlers)
