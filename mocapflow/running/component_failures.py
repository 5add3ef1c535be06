"""Says which component failed, at which frame, and what is saved."""

from __future__ import annotations

import errno
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType, TracebackType

from pydantic import ValidationError

from mocapflow.errors import (
    FULL,
    ComponentFailed,
    MocapflowError,
    PluginError,
    ShapeError,
    StoreError,
    moment_of,
    raised,
    unwritable,
)
from mocapflow.interrupts import interrupted
from mocapflow.output_checks import InvalidOutput
from mocapflow.registry import Registry
from mocapflow.settings import Component
from mocapflow.storage.checkpoint import Checkpoint

FAILURE_LOG = "failed.log"  # in the run folder, the traceback of the last failure


@contextmanager
def naming_failures(
    component: Component, registry: Registry, log: Path | None, checkpoint: Checkpoint | None = None
) -> Iterator[None]:
    """If a component raises, say who it was, what is saved and how to go on.

    Args:
        component: what is running, or what it runs.
        registry: knows which packages are plugins.
        log: where to write the whole traceback; None: nowhere.
        checkpoint: knows what is saved, and how to go on; None: nothing is.
    """
    try:
        yield
    except ComponentFailed:
        raise
    except (Exception, SystemExit) as error:
        if interrupted(error):
            raise KeyboardInterrupt from None
        if isinstance(error, MocapflowError) and not isinstance(error, ShapeError | PluginError):
            if not isinstance(error, StoreError):
                error.where = error.where or _named(_culprit(error, registry) or component)
            raise
        if isinstance(error, OSError) and _nobodys(error, log) and (said := unwritable(error)):
            raise said from error
        raise _failure(error, component, registry, checkpoint.kept if checkpoint else "", log) from error


def _nobodys(error: OSError, log: Path | None) -> bool:
    """Return whether it is no component's fault: a drive is full, or the run folder can't be written."""
    inside = log and error.filename and Path(str(error.filename)).absolute().is_relative_to(log.parent.absolute())
    return error.errno in {*FULL, errno.EROFS} or bool(inside)


def _failure(
    error: BaseException, stage: Component, registry: Registry, saved: str, log: Path | None
) -> ComponentFailed:
    """Return the error for people: the innermost frame of the traceback in a plugin names the culprit."""
    component = error.component if isinstance(error, InvalidOutput) else _culprit(error, registry) or stage
    moment = f" at {when}" if (when := moment_of(error)) else ""
    message = f"{_named(component)} ({registry.origin(type(component))}) failed{moment}: {_reason(error)}"
    hints = [saved, _write_traceback(error, log)]
    return ComponentFailed(message, hint="\n".join(filter(None, hints)))


def _named(component: Component) -> str:
    return f"{component.role.replace('_', ' ')} '{component.name}'"


def _calls(trace: TracebackType | None) -> Iterator[FrameType]:
    while trace is not None:
        yield trace.tb_frame
        trace = trace.tb_next


def _culprit(error: BaseException, registry: Registry) -> Component | None:
    """Return the component nearest to the innermost call in plugin code."""
    calls = list(_calls(error.__traceback__))
    return next((call.f_locals["self"] for call in reversed(calls) if _is_known(call, registry)), None)


def _is_known(call: FrameType, registry: Registry) -> bool:
    this = call.f_locals.get("self")
    if not isinstance(this, Component):
        return False
    try:
        registry.origin(type(this))
    except KeyError:
        return False
    return True


def _reason(error: BaseException) -> str:
    if isinstance(error, ValidationError) and (first := error.errors()[0])["type"] == "frozen_instance":
        return f"it sets '{first['loc'][0]}', but a component is frozen and keeps nothing between calls"
    if isinstance(error, InvalidOutput):
        return f"it returned {error.what}"
    return raised(error)


def _write_traceback(error: BaseException, log: Path | None) -> str:
    """Write the traceback and return where it is, for people; "" where it can't be written."""
    if log is None:
        return ""
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    except OSError:
        return ""
    return f"traceback: {log}"
