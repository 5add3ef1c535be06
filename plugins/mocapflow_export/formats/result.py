"""What every writer gets."""

from __future__ import annotations

from functools import cached_property
from importlib import import_module
from types import ModuleType

import numpy as np

from mocapflow.data import NO_CLOTH, PoseBatch, Surface
from mocapflow.errors import PipelineError
from mocapflow.geometry import kinematics
from mocapflow.geometry.angles import AngleSeries
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64, record
from mocapflow.results import Track, ViewChecks
from mocapflow.scene import Scene
from mocapflow_export.uncertainty import measured


@record
class Result:
    """A track with what it is a track of."""

    track: Track
    scene: Scene
    recording: Recording
    checks: ViewChecks | None = None  # of its pictures

    @cached_property
    def joints(self) -> F64:
        """World_from_rest of every joint: (T, J, 4, 4) m."""
        return kinematics.chain_batch(self.scene.body, PoseBatch(root=self.track.root, angles=self.track.angles))

    @cached_property
    def places(self) -> F64:
        """Joint centres: (T, J, 3) m."""
        return kinematics.joint_positions(self.scene.body, self.joints)

    @cached_property
    def turns(self) -> F64:
        """Rotation of every joint relative to its parent, of the root in the world: (T, J, 3, 3)."""
        world, parents = self.joints[..., :3, :3], self.scene.body.parents
        relative: F64 = np.swapaxes(world[:, parents], -1, -2) @ world
        relative[:, parents < 0] = world[:, parents < 0]
        return relative

    @cached_property
    def angles(self) -> AngleSeries:
        """The angles, with calibrated deviations."""
        return measured(self.track, self.scene)

    def surface(self, row: int) -> Surface:
        """Return body and garment in one frame."""
        return self.scene.surface(self.track.pose(row), self.track.cloth_at(row))

    def bare(self, row: int) -> Surface:
        """Return the body alone in one frame."""
        return self.scene.undressed.surface(self.track.pose(row), NO_CLOTH)


def library(module: str, extra: str) -> ModuleType:
    """Return a module that one of the optional extras brings.

    Raises:
        PipelineError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise lacking(f"{module.partition('.')[0]}: {error}", extra) from error


def lacking(what: str, extra: str) -> PipelineError:
    """Return the error of a format that lacks something which an extra brings."""
    return PipelineError(f"this format needs {what}", hint=f"pip install 'mocapflow[{extra}]'")
