"""mocapflow: motion capture of people in loose clothes.

The public names; each is imported when it is first used, so that `import mocapflow` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # renamed to themselves: what type checkers take for exported
    from mocapflow.assets import Background as Background
    from mocapflow.assets import Body as Body
    from mocapflow.assets import Camera as Camera
    from mocapflow.assets import GarmentMesh as GarmentMesh
    from mocapflow.components import ClothFitter as ClothFitter
    from mocapflow.components import Matcher as Matcher
    from mocapflow.components import PoseSolver as PoseSolver
    from mocapflow.components import Predictor as Predictor
    from mocapflow.components import Prior as Prior
    from mocapflow.components import Recovery as Recovery
    from mocapflow.components import Segmenter as Segmenter
    from mocapflow.components import Stage as Stage
    from mocapflow.config.pipeline import Pipeline as Pipeline
    from mocapflow.config.pipeline import load_pipeline as load_pipeline
    from mocapflow.data import Cloth as Cloth
    from mocapflow.data import Estimate as Estimate
    from mocapflow.data import Frame as Frame
    from mocapflow.data import FrameResult as FrameResult
    from mocapflow.data import FrameState as FrameState
    from mocapflow.data import Matches as Matches
    from mocapflow.data import Past as Past
    from mocapflow.data import Pose as Pose
    from mocapflow.data import PoseBatch as PoseBatch
    from mocapflow.data import Residual as Residual
    from mocapflow.data import Segmentation as Segmentation
    from mocapflow.data import Silhouette as Silhouette
    from mocapflow.data import Start as Start
    from mocapflow.data import Surface as Surface
    from mocapflow.data import Turn as Turn
    from mocapflow.dressing.roles import BodyModel as BodyModel
    from mocapflow.dressing.roles import Draper as Draper
    from mocapflow.dressing.roles import Garment as Garment
    from mocapflow.dressing.tailor import Tailor as Tailor
    from mocapflow.errors import GarmentError as GarmentError
    from mocapflow.errors import MocapflowError as MocapflowError
    from mocapflow.errors import PipelineError as PipelineError
    from mocapflow.errors import PluginError as PluginError
    from mocapflow.hookspecs import hookimpl as hookimpl
    from mocapflow.model import ClothedModel as ClothedModel
    from mocapflow.recordings.recording import Recording as Recording
    from mocapflow.registry import Registry as Registry
    from mocapflow.registry import load_registry as load_registry
    from mocapflow.results import Files as Files
    from mocapflow.results import RunFolder as RunFolder
    from mocapflow.results import Track as Track
    from mocapflow.running.runner import plan as plan
    from mocapflow.running.runner import run as run
    from mocapflow.scene import Scene as Scene
    from mocapflow.settings import Component as Component

_NAMES = {
    "assets": "Background Body Camera GarmentMesh",
    "components": "ClothFitter Matcher PoseSolver Predictor Prior Recovery Segmenter Stage",
    "config.pipeline": "Pipeline load_pipeline",
    "data": "Cloth Estimate Frame FrameResult FrameState Matches Past Pose PoseBatch Residual Segmentation Silhouette "
    "Start Surface Turn",
    "dressing.roles": "BodyModel Draper Garment",
    "dressing.tailor": "Tailor",
    "errors": "GarmentError MocapflowError PipelineError PluginError",
    "hookspecs": "hookimpl",
    "model": "ClothedModel",
    "recordings.recording": "Recording",
    "registry": "Registry load_registry",
    "results": "Files RunFolder Track",
    "running.runner": "plan run",
    "scene": "Scene",
    "settings": "Component",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mocapflow' has no attribute '{name}'")
    return getattr(import_module(f"mocapflow.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
