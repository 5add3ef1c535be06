"""Recoveries: ways to notice that a fit is lost, and to find the person again."""

from __future__ import annotations

from mocapflow.components import Recovery, Stage
from mocapflow.hookspecs import hookimpl


@hookimpl
def mocapflow_recoveries() -> list[type[Recovery]]:
    """Return the built-in recoveries."""
    from mocapflow_recovery.limb_search import LimbSearch

    return [LimbSearch]


@hookimpl
def mocapflow_stages() -> list[type[Stage]]:
    """Return the stages that find the person and how tall they are, and that look at a finished track again."""
    from mocapflow_recovery.check_keypoints import CheckKeypoints
    from mocapflow_recovery.fit_stature import FitStature
    from mocapflow_recovery.second_look import SecondLook
    from mocapflow_recovery.start_from_silhouettes import StartFromSilhouettes

    return [FitStature, StartFromSilhouettes, SecondLook, CheckKeypoints]
