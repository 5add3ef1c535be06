"""The scene with its draper: the surface at any pose, and how cloth moves with pose and parameters."""

from __future__ import annotations

from weakref import ref

import numpy as np

from mocapflow.data import NO_CLOTH, Cloth, Past, Pose, PoseBatch, Surface
from mocapflow.dressing.guards import drape_of, velocity_of
from mocapflow.dressing.roles import Draper
from mocapflow.geometry import twists
from mocapflow.memo import memoised
from mocapflow.records import F64, I32, record
from mocapflow.scene import Scene


@record
class ClothedModel:
    """Scene and draper; without a garment the draper is None and the surface is the body alone."""

    scene: Scene
    draper: Draper | None = None

    @property
    def clothed(self) -> bool:
        """True where there is a garment to drape."""
        return self.draper is not None and self.scene.garment is not None

    def drape(self, pose: Pose, parameters: F64, past: Past) -> Cloth:
        """Return the garment laid on one pose."""
        if not self.clothed:
            return NO_CLOTH
        return _laid(pose, tuple(parameters.tolist()), ref(past), self)

    def drapes(self, pose: Pose, parameters: F64, past: Past) -> F64:
        """Return the garment's vertices (B, W, 3) laid on one pose with parameters (B, Q)."""
        if self.draper is None or self.scene.garment is None:
            return np.empty((len(parameters), 0, 3))
        root, angles = (np.repeat(part[None], len(parameters), axis=0) for part in (pose.root, pose.angles))
        poses = PoseBatch(root=root, angles=angles)
        return drape_of(self.draper, poses, parameters, past, self.scene)

    def surface(self, pose: Pose, cloth: Cloth) -> Surface:
        """Return body and given cloth posed in the world."""
        return self.scene.surface(pose, cloth)

    def velocity(self, pose: Pose, cloth: Cloth, vertices: I32, past: Past) -> F64:
        """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,), numbered within the garment."""
        if self.draper is None or self.scene.garment is None:
            return np.zeros((len(vertices), 3, 6 + len(pose.angles)))
        return velocity_of(self.draper, pose, cloth.parameters, vertices, past, self.scene)


@memoised
def _laid(pose: Pose, parameters: tuple[float, ...], past: ref[Past], model: ClothedModel) -> Cloth:
    """Return the garment laid on a pose; the past holds earlier poses, which are to be forgotten, so it is weak."""
    values, known = np.array(parameters, float), past()
    assert known is not None
    return Cloth(vertices=model.drapes(pose, values[None], known)[0], parameters=values)


def increment_between(one: Pose, other: Pose) -> F64:
    """Return the increment (6 + D,) that leads from one pose to another; see `moved`."""
    return np.concatenate([twists.log(other.root @ twists.inverse(one.root)), other.angles - one.angles])


def moved(pose: Pose, increment: F64) -> Pose:
    """Return a pose after an increment (6 + D,): the twist is left-multiplied, the angles are added."""
    return Pose(root=twists.exp(increment[:6]) @ pose.root, angles=pose.angles + increment[6:])
