"""Keeps what a stage warns of while it runs: on a terminal it is soon out of sight."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from mocapflow.observers import LOG


class _Keeper(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []
        self._thread = threading.get_ident()  # another thread may be running another pipeline

    def emit(self, record: logging.LogRecord) -> None:
        if record.name != LOG.name and record.thread == self._thread:  # observers change no result
            self.said.append(record.getMessage())


@contextmanager
def warnings_logged() -> Iterator[list[str]]:
    """Give a list that fills with what mocapflow and plugins log as a warning, or worse, meanwhile, by this thread."""
    tops = {name.partition(".")[0] for name in list(sys.modules) if name.startswith("mocapflow")}
    keeper, loggers = _Keeper(), [logging.getLogger(top) for top in tops]  # of which those of modules are children
    for logger in loggers:
        logger.addHandler(keeper)
    try:
        yield keeper.said
    finally:
        for logger in loggers:
            logger.removeHandler(keeper)
