"""mocapflow: motion capture of people in loose clothes.

The public names; each is imported when it is first used, so that `import mocapflow` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mocapflow.assets import Background, Body, Camera, GarmentMesh
    from mocapflow.components import (
        BodyModel,
        ClothFitter,
        Component,
        Draper,
        Garment,
        Matcher,
        PoseSolver,
        Predictor,
        Prior,
        Recovery,
        Segmenter,
        Stage,
    )
    from mocapflow.config.pipeline import Pipeline, load_pipeline
    from mocapflow.data import (
        Cloth,
        Estimate,
        Frame,
        FrameResult,
        FrameState,
        Matches,
        Past,
        Pose,
        PoseBatch,
        Residual,
        Segmentation,
        Silhouette,
        Start,
        Surface,
        Turn,
    )
    from mocapflow.errors import GarmentError, MocapflowError, PipelineError, PluginError
    from mocapflow.hookspecs import hookimpl
    from mocapflow.model import ClothedModel
    from mocapflow.recordings.recording import Recording
    from mocapflow.registry import Registry, load_registry
    from mocapflow.results import Files, RunFolder, Track
    from mocapflow.running.runner import plan, run
    from mocapflow.scene import Scene

_HOMES = {
    "assets": "Background Body Camera GarmentMesh",
    "components": "BodyModel ClothFitter Component Draper Garment Matcher PoseSolver Predictor Prior "
    "Recovery Segmenter Stage",
    "config.pipeline": "Pipeline load_pipeline",
    "data": "Cloth Estimate Frame FrameResult FrameState Matches Past Pose PoseBatch Residual Segmentation Silhouette "
    "Start Surface Turn",
    "errors": "GarmentError MocapflowError PipelineError PluginError",
    "hookspecs": "hookimpl",
    "model": "ClothedModel",
    "recordings.recording": "Recording",
    "registry": "Registry load_registry",
    "results": "Files RunFolder Track",
    "running.runner": "plan run",
    "scene": "Scene",
}

__all__ = [  # noqa: PLE0604
    "Background",
    "Body",
    "BodyModel",
    "Camera",
    "Cloth",
    "ClothFitter",
    "ClothedModel",
    "Component",
    "Draper",
    "Estimate",
    "Files",
    "Frame",
    "FrameResult",
    "FrameState",
    "Garment",
    "GarmentError",
    "GarmentMesh",
    "Matcher",
    "Matches",
    "MocapflowError",
    "Past",
    "Pipeline",
    "PipelineError",
    "PluginError",
    "Pose",
    "PoseBatch",
    "PoseSolver",
    "Predictor",
    "Prior",
    "Recovery",
    "Recording",
    "Registry",
    "Residual",
    "RunFolder",
    "Scene",
    "Segmentation",
    "Segmenter",
    "Silhouette",
    "Stage",
    "Start",
    "Surface",
    "Track",
    "Turn",
    "hookimpl",
    "load_pipeline",
    "load_registry",
    "plan",
    "run",
]


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names.split():
            return getattr(import_module(f"mocapflow.{module}"), name)
    raise AttributeError(f"module 'mocapflow' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
