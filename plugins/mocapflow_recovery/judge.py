"""How well poses agree with what the images surely show, by two measures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.data import NO_CLOTH, Cloth, FrameResult, Past, Pose, PoseBatch, Surface
from mocapflow.dressing.guards import drape_of
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_recovery.certain import View
from mocapflow_recovery.disagreement import distance, floating_area, uncovered_areas

REACH_M = 0.06  # what lies nearer to the other does not stray
HINT_M = 0.03  # the same, of what is but a hint
CLOTH_M = 0.2  # what lies so near to the garment may be the garment, wherever it swings
CAP_M = 0.2  # beyond, it does not matter how far
FACES = 2600  # of a body that many poses are measured with, about


class Stray(NamedTuple):
    """How much of person and model lie apart, cm²."""

    uncovered: float
    floating: float
    cloth: float  # uncovered as well; a limb may hold it there, or it flies
    near: float  # of the person, without cloth, off the model by `HINT_M` or more

    @property
    def area(self) -> float:
        """What contradicts a fit, cm²."""
        return self.uncovered + self.floating

    def __str__(self) -> str:
        worn = f" ({self.cloth:.0f} of it cloth)" if self.cloth >= 0.5 else ""
        area = self.uncovered + self.cloth
        return f"{area:.0f} cm² of the person uncovered{worn}, {self.floating:.0f} cm² of skin in empty space"


def stray_of(surface: Surface, scene: Scene, seen: Sequence[View]) -> Stray:
    """Return how much of the person lies off a surface of the scene, and of its skin off the person."""
    (skin, cloth), (near, _) = 1e4 * uncovered_areas(surface, seen, (REACH_M, HINT_M), CLOTH_M)
    floating = 1e4 * floating_area(scene.bare(surface), seen, REACH_M)
    return Stray(uncovered=skin, floating=floating, cloth=cloth, near=near)


class Fit(NamedTuple):
    """A result, and how well it agrees with what the images surely show."""

    result: FrameResult
    stray: Stray
    apart: float  # see `Judge.apart`


class Given(NamedTuple):
    """A pose that was given beforehand, about right: of two that fit alike the one nearer to it is taken."""

    pose: Pose
    sd: float  # rad, of its angles

    def strain(self, pose: Pose) -> float:
        """Return the factor by which a pose counts as farther from the person for being far from the given one."""
        return 1.0 + float(np.sqrt(np.mean(((pose.angles - self.pose.angles) / self.sd) ** 2)))


class Judge(NamedTuple):
    """Measures poses of a coarse body in the garment as it is believed."""

    model: ClothedModel  # drapes the garment
    coarse: Scene  # its body has few faces
    seen: Sequence[View]
    parameters: F64  # of the cloth
    past: Past
    given: Given | None  # None: nothing was
    cloth: float  # what a pixel of cloth counts, on either side

    def of(self, result: FrameResult) -> Fit:
        """Return a result judged by its full surface."""
        pose, surface = result.state.estimate.pose, surface_of(self.model, result)
        stray = stray_of(surface, self.model.scene, self.seen)
        return Fit(result, stray, self._apart(pose, surface, self.model.scene))

    def apart(self, poses: Sequence[Pose]) -> F64:
        """Return for each pose (B,) how far surface and person are apart, m per unit of its area, times the strain."""
        pairs = zip(poses, self._surfaces(poses), strict=True)
        return np.array([self._apart(pose, surface, self.coarse) for pose, surface in pairs])

    def stray(self, poses: Sequence[Pose]) -> F64:
        """Return for each pose (B,) how much of surface and person strays, without cloth, cm²."""
        return np.array([stray_of(surface, self.coarse, self.seen).area for surface in self._surfaces(poses)])

    def _apart(self, pose: Pose, surface: Surface, scene: Scene) -> float:
        strain = self.given.strain(pose) if self.given else 1.0
        return strain * distance(surface, scene.bare(surface), self.seen, CAP_M, self.cloth)

    def _surfaces(self, poses: Sequence[Pose]) -> list[Surface]:
        clothes = drapes(self.model, poses, self.parameters, self.past)
        return [self.coarse.surface(pose, cloth) for pose, cloth in zip(poses, clothes, strict=True)]


def surface_of(model: ClothedModel, result: FrameResult) -> Surface:
    """Return the surface that a result believes in."""
    return model.surface(result.state.estimate.pose, result.state.cloth)


def drapes(model: ClothedModel, poses: Sequence[Pose], parameters: F64, past: Past) -> list[Cloth]:
    """Return the garment laid on each of several poses; poses that lay it alike are draped once."""
    if model.draper is None or not model.clothed:
        return [NO_CLOTH] * len(poses)
    lays = model.draper.touchable(model.scene)[model.scene.body.screw_joint]
    root, angles = np.stack([pose.root for pose in poses]), np.stack([pose.angles for pose in poses])
    told_apart = np.concatenate([root.reshape(len(poses), -1), angles[:, lays]], axis=1)
    _, first, same = np.unique(told_apart, axis=0, return_index=True, return_inverse=True)
    batch = PoseBatch(root=root[first], angles=angles[first])
    vertices = drape_of(model.draper, batch, np.repeat(parameters[None], len(first), axis=0), past, model.scene)
    return [Cloth(vertices=vertices[row], parameters=parameters) for row in same.ravel()]
