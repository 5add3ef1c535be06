"""The scene with its draper: the surface at any pose, and how cloth moves with pose and parameters."""

from __future__ import annotations

import numpy as np

from mocapflow.components import Draper
from mocapflow.data import NO_CLOTH, Cloth, Past, Pose, PoseBatch, Surface
from mocapflow.geometry import kinematics, twists
from mocapflow.records import F64, I32, record
from mocapflow.scene import Scene

ANGLE_STEP = np.radians(1.0)  # rad; averages over changes of contact (method: finite differences of the drape)
PARAMETER_STEP = 0.02  # share of the parameter's range


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
        if self.draper is None or self.scene.garment is None:
            return NO_CLOTH
        poses = PoseBatch(root=pose.root[None], angles=pose.angles[None])
        vertices = self.draper.drape(poses, parameters[None], past, self.scene)[0]
        return Cloth(vertices=vertices, parameters=parameters)

    def surface(self, pose: Pose, cloth: Cloth) -> Surface:
        """Return body and given cloth posed in the world."""
        return self.scene.surface(pose, cloth)

    def velocity(self, pose: Pose, cloth: Cloth, vertices: I32, past: Past) -> F64:
        """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,), numbered within the garment."""
        if self.draper is None:
            return np.zeros((len(vertices), 3, 6 + len(pose.angles)))
        return self.draper.velocity(pose, cloth.parameters, vertices, past, self.scene)


def moved(pose: Pose, increment: F64) -> Pose:
    """Return a pose after an increment (6 + D,): the twist is left-multiplied, the angles are added."""
    return Pose(root=twists.exp(increment[:6]) @ pose.root, angles=pose.angles + increment[6:])


def drape_differences(draper: Draper, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
    """Return velocities (M, 3, 6 + D + Q) of cloth vertices (M,) by forward differences of one batch of drapes.

    The root carries the garment rigidly: exact for shifts and for turns about the vertical, and nearly so for the
    small tilts of one step. Only angles that move what the garment can touch are tried.
    """
    assert scene.garment is not None
    angles, unknowns = len(pose.angles), 6 + len(pose.angles) + len(parameters)
    below = kinematics.descendants(scene.body.parents)
    touching = below[scene.body.screw_joint] @ draper.touchable(scene)
    tried = np.concatenate([6 + np.flatnonzero(touching), np.arange(6 + angles, unknowns)])
    lower, upper = scene.garment.parameter_bounds.T
    inward = np.where(parameters > 0.5 * (lower + upper), -1.0, 1.0)  # never a step beyond the bounds
    steps = np.concatenate([np.full(6 + angles, ANGLE_STEP), PARAMETER_STEP * (upper - lower) * inward])[tried]
    moves = np.zeros((len(tried) + 1, unknowns))
    moves[np.arange(len(tried)), tried] = steps
    batch = PoseBatch(
        root=np.repeat(pose.root[None], len(moves), axis=0), angles=pose.angles + moves[:, 6 : 6 + angles]
    )
    draped = draper.drape(batch, parameters + moves[:, 6 + angles :], past, scene)[:, vertices]
    velocity = np.zeros((len(vertices), 3, unknowns))
    velocity[..., :3] = -twists.hat(draped[-1])
    velocity[..., 3:6] = np.eye(3)
    velocity[..., tried] = np.moveaxis(draped[:-1] - draped[-1], 0, -1) / np.where(steps == 0, 1.0, steps)
    return velocity
