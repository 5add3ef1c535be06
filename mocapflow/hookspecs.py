"""The extension points: eleven providers return component classes, three observers look on."""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from mocapflow.components import ClothFitter, Matcher, PoseSolver, Predictor, Prior, Recovery, Segmenter, Stage
from mocapflow.data import FrameResult, FrameState
from mocapflow.dressing.roles import BodyModel, Draper, Garment

hookspec = pluggy.HookspecMarker("mocapflow")
hookimpl = pluggy.HookimplMarker("mocapflow")


@hookspec
def mocapflow_predictors() -> Iterable[type[Predictor]]:  # type: ignore[empty-body]
    """Ways to guess the next pose before looking."""


@hookspec
def mocapflow_segmenters() -> Iterable[type[Segmenter]]:  # type: ignore[empty-body]
    """Ways to find the silhouette in each image."""


@hookspec
def mocapflow_matchers() -> Iterable[type[Matcher]]:  # type: ignore[empty-body]
    """Ways to pair image points with surface points."""


@hookspec
def mocapflow_pose_solvers() -> Iterable[type[PoseSolver]]:  # type: ignore[empty-body]
    """Ways to compute the pose from matches and priors."""


@hookspec
def mocapflow_drapers() -> Iterable[type[Draper]]:  # type: ignore[empty-body]
    """Ways to lay a garment on posed bodies: the forward model."""


@hookspec
def mocapflow_cloth_fitters() -> Iterable[type[ClothFitter]]:  # type: ignore[empty-body]
    """Ways to choose the cloth parameters and forces that explain the images."""


@hookspec
def mocapflow_recoveries() -> Iterable[type[Recovery]]:  # type: ignore[empty-body]
    """Ways to notice that a fit is lost, and to find the person again."""


@hookspec
def mocapflow_priors() -> Iterable[type[Prior]]:  # type: ignore[empty-body]
    """Terms the pose solver adds: limits, learned poses, ground."""


@hookspec
def mocapflow_garments() -> Iterable[type[Garment]]:  # type: ignore[empty-body]
    """Garments: rest mesh, attachment, parameters."""


@hookspec
def mocapflow_bodies() -> Iterable[type[BodyModel]]:  # type: ignore[empty-body]
    """Bodies: mesh, joints, skinning."""


@hookspec
def mocapflow_stages() -> Iterable[type[Stage]]:  # type: ignore[empty-body]
    """Whole-sequence stages: flow, start, smooth, evaluate, export, report."""


@hookspec
def mocapflow_iteration_done(frame: int, iteration: int, state: FrameState) -> None:
    """After each turn of the loop (viewers, debugging)."""


@hookspec
def mocapflow_frame_done(frame: int, result: FrameResult) -> None:
    """After a frame is committed."""


@hookspec
def mocapflow_stage_done(stage: str, key: str, cached: bool) -> None:
    """After a stage finished or was found in the cache."""
