"""Tells plugins what happens during a run; they look on and cannot change a result."""

from __future__ import annotations

import logging
from typing import Any

import pluggy

from mocapflow.data import FrameResult, FrameState
from mocapflow.interrupts import interrupted

LOG = logging.getLogger("mocapflow.observers")


class Observers:
    """Broadcasts to every plugin that looks on; one that raises is reported once and switched off."""

    def __init__(self, manager: pluggy.PluginManager) -> None:
        self._manager = manager
        self._off: set[Any] = set()

    def iteration_done(self, frame: int, iteration: int, state: FrameState) -> None:
        """Report one turn of the loop."""
        self._tell("mocapflow_iteration_done", frame=frame, iteration=iteration, state=state)

    def frame_done(self, frame: int, result: FrameResult) -> None:
        """Report a committed frame."""
        self._tell("mocapflow_frame_done", frame=frame, result=result)

    def stage_done(self, stage: str, key: str, cached: bool) -> None:
        """Report a stage that finished or was found in the cache."""
        self._tell("mocapflow_stage_done", stage=stage, key=key, cached=cached)

    def _tell(self, hook: str, **news: Any) -> None:
        for observer in getattr(self._manager.hook, hook).get_hookimpls():
            if observer.function in self._off:
                continue
            try:
                observer.function(*(news[name] for name in observer.argnames))
            except (Exception, SystemExit) as error:  # an onlooker must never stop a run
                if interrupted(error):
                    raise KeyboardInterrupt from None
                self._off.add(observer.function)
                text = "observer %s of plugin '%s' raised %s: %s; it is switched off for the rest of this run"
                LOG.warning(text, hook, observer.plugin_name, type(error).__name__, error)
