"""Keeps what a stage warns of while it runs: on a terminal it is soon out of sight."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from mocapflow.observers import LOG


class _Keeper(logging.Handler):
    def __init__(self, packages: Collection[str]) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []
        self._packages = packages
        self._thread = threading.get_ident()  # another thread may be running another pipeline

    def emit(self, record: logging.LogRecord) -> None:
        if record.name != LOG.name and record.thread == self._thread and self._of_plugins(record):
            self.said.append(record.getMessage())  # those of observers change no result

    def _of_plugins(self, record: logging.LogRecord) -> bool:
        """Return whether mocapflow or a plugin says it: loggers may have any name, so the code that logs counts too."""
        return record.name.startswith("mocapflow") or any(
            getattr(module, "__file__", None) == record.pathname
            for name, module in list(sys.modules.items())
            if name.partition(".")[0] in self._packages
        )


@contextmanager
def warnings_logged(packages: Collection[str] = ()) -> Iterator[list[str]]:
    """Give a list that fills with what mocapflow and plugins log as a warning, or worse, meanwhile, by this thread.

    Args:
        packages: those of the plugins, by their top names.
    """
    keeper, root = _Keeper(packages), logging.getLogger()
    root.addHandler(keeper)
    try:
        yield keeper.said
    finally:
        root.removeHandler(keeper)
