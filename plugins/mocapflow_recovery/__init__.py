"""Recoveries: ways to notice that a fit is lost, and to find the person again."""

from __future__ import annotations

from mocapflow.components import Recovery
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_recoveries() -> list[type[Recovery]]:
    """Return the built-in recoveries."""
    from mocapflow_recovery.limb_search import LimbSearch

    return [LimbSearch]
