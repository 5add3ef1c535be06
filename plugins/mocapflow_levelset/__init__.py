"""Segmenters: the chapter's level set, with contours inside it or without, difference to the empty scene, grabCut."""

from __future__ import annotations

from mocapflow.components import Segmenter
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_segmenters() -> list[type[Segmenter]]:
    """Return the segmenters of this package."""
    from mocapflow_levelset.background import BackgroundDifference
    from mocapflow_levelset.grabcut import GrabCut
    from mocapflow_levelset.layered import Layered
    from mocapflow_levelset.levelset import LevelSet

    return [LevelSet, Layered, BackgroundDifference, GrabCut]
