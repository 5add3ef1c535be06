"""The scene with its draper: the surface at any pose, and how cloth moves with pose and parameters."""

from __future__ import annotations

import numpy as np

from mocapflow.components import Draper
from mocapflow.data import NO_CLOTH, Cloth, Past, Pose, PoseBatch, Surface
from mocapflow.geometry import twists
from mocapflow.records import F64, I32, record
from mocapflow.scene import Scene

ANGLE_STEP = np.radians(1.0)  # rad; averages over changes of contact (method: finite differences of the drape)
SHIFT_STEP = 0.005  # m
PARAMETER_STEP = 0.01  # share of the parameter's range


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
    """Return velocities (M, 3, 6 + D + Q) of cloth vertices by central differences of one batch of drapes."""
    assert scene.garment is not None
    ranges = np.ptp(scene.garment.parameter_bounds, axis=1)
    steps = np.concatenate(
        [np.full(3, ANGLE_STEP), np.full(3, SHIFT_STEP), np.full(len(pose.angles), ANGLE_STEP), PARAMETER_STEP * ranges]
    )
    pelvis = pose.root[:3, 3]  # turn about the root, not the world origin: the same derivative, a smaller error
    about_origin = np.eye(len(steps))
    about_origin[3:6, :3] = twists.hat(pelvis)
    columns = len(pose.angles) + 6
    moves = np.concatenate([np.diag(steps), -np.diag(steps)])
    poses = [moved(pose, about_origin[:columns, :columns] @ move[:columns]) for move in moves]
    batch = PoseBatch(root=np.stack([p.root for p in poses]), angles=np.stack([p.angles for p in poses]))
    draped = draper.drape(batch, parameters + moves[:, columns:], past, scene)[:, vertices]
    forward, backward = np.split(draped, 2)
    about_root = np.moveaxis(forward - backward, 0, -1) / (2 * steps)  # (M, 3, S)
    # velocity = about_root @ (increment expressed about the root) and increment_root = about_origin^-1 increment
    velocity: F64 = about_root @ np.linalg.inv(about_origin)
    return velocity
