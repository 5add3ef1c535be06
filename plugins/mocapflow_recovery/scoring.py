"""How well poses agree with trimaps of the images, by two measures: a distance, and areas of mismatch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.data import NO_CLOTH, Cloth, FrameResult, Past, Pose, PoseBatch, Surface
from mocapflow.dressing.guards import drape_of
from mocapflow.dressing.pieces import touchable
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_recovery.disagreement import chamfer_distance, floating_area, uncovered_areas
from mocapflow_recovery.trimaps import Trimap

REACH_M = 0.06  # what of person or model lies nearer to the other is no mismatch
HINT_M = 0.03  # the same, of what is but a hint
CLOTH_M = 0.2  # what lies so near to the garment may be the garment, wherever it swings
CAP_M = 0.2  # beyond, it does not matter how far
FACES = 2600  # of a body that many poses are measured with, about


class Mismatch(NamedTuple):
    """How much of person and model lie apart, cm²."""

    uncovered: float
    floating: float
    cloth: float  # uncovered as well; a limb may hold it there, or it flies
    hint: float  # of the person, without cloth, off the model by `HINT_M` or more

    @property
    def area(self) -> float:
        """What contradicts a fit, cm²."""
        return self.uncovered + self.floating

    def __str__(self) -> str:
        worn = f" ({self.cloth:.0f} of it cloth)" if self.cloth >= 0.5 else ""
        area = self.uncovered + self.cloth
        return f"{area:.0f} cm² of the person uncovered{worn}, {self.floating:.0f} cm² of skin in empty space"


def mismatch_of(surface: Surface, scene: Scene, trimaps: Sequence[Trimap]) -> Mismatch:
    """Return how much of the person lies off a surface of the scene, and of its skin off the person."""
    (skin, cloth), (hint, _) = 1e4 * uncovered_areas(surface, trimaps, (REACH_M, HINT_M), CLOTH_M)
    floating = 1e4 * floating_area(scene.bare(surface), trimaps, REACH_M)
    return Mismatch(uncovered=skin, floating=floating, cloth=cloth, hint=hint)


class Fit(NamedTuple):
    """A result, and how well it agrees with what the images surely show."""

    result: FrameResult
    mismatch: Mismatch
    distance: float  # see `Scorer.distances`


class StartPose(NamedTuple):
    """A pose that was given as a start, about right: of two that fit alike the one nearer to it is taken."""

    pose: Pose
    sd: float  # rad, of its angles

    def penalty(self, pose: Pose) -> float:
        """Return the factor by which a pose counts as farther from the person for being far from the start."""
        return 1.0 + float(np.sqrt(np.mean(((pose.angles - self.pose.angles) / self.sd) ** 2)))


class Scorer(NamedTuple):
    """Scores poses of a coarse body, in the garment with some parameters."""

    model: ClothedModel  # drapes the garment
    coarse: Scene  # its body has few faces
    trimaps: Sequence[Trimap]
    parameters: F64  # of the cloth
    past: Past
    start: StartPose | None  # None: none was given
    cloth_weight: float  # of a pixel of cloth, of person and model

    def score(self, result: FrameResult) -> Fit:
        """Return a result scored by its full surface."""
        pose, surface = result.state.estimate.pose, self.model.scene.surface_of(result.state)
        mismatch = mismatch_of(surface, self.model.scene, self.trimaps)
        return Fit(result, mismatch, self._distance(pose, surface, self.model.scene))

    def distances(self, poses: Sequence[Pose]) -> F64:
        """Return for each pose (B,) the distance of surface and person, m per unit of its area, times the penalty."""
        pairs = zip(poses, self._surfaces(poses), strict=True)
        return np.array([self._distance(pose, surface, self.coarse) for pose, surface in pairs])

    def mismatches(self, poses: Sequence[Pose]) -> F64:
        """Return for each pose (B,) the mismatch of surface and person, without cloth, cm²."""
        return np.array([mismatch_of(surface, self.coarse, self.trimaps).area for surface in self._surfaces(poses)])

    def _distance(self, pose: Pose, surface: Surface, scene: Scene) -> float:
        penalty = self.start.penalty(pose) if self.start else 1.0
        return penalty * chamfer_distance(surface, scene.bare(surface), self.trimaps, CAP_M, self.cloth_weight)

    def _surfaces(self, poses: Sequence[Pose]) -> list[Surface]:
        clothes = drapes(self.model, poses, self.parameters, self.past)
        return [self.coarse.surface(pose, cloth) for pose, cloth in zip(poses, clothes, strict=True)]


def drapes(model: ClothedModel, poses: Sequence[Pose], parameters: F64, past: Past) -> list[Cloth]:
    """Return the garment laid on each of several poses; poses that lay it alike are draped once."""
    if model.draper is None or not model.clothed:
        return [NO_CLOTH] * len(poses)
    lays = touchable(model.draper, model.scene)[model.scene.body.screw_joint]
    root, angles = np.stack([pose.root for pose in poses]), np.stack([pose.angles for pose in poses])
    differing = np.concatenate([root.reshape(len(poses), -1), angles[:, lays]], axis=1)
    _, first, same = np.unique(differing, axis=0, return_index=True, return_inverse=True)
    batch = PoseBatch(root=root[first], angles=angles[first])
    vertices = drape_of(model.draper, batch, np.repeat(parameters[None], len(first), axis=0), past, model.scene)
    return [Cloth(vertices=vertices[row], parameters=parameters) for row in same.ravel()]
