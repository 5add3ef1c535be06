"""What does not change during a recording: rig, body, garment, background."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from mocapflow.assets import Background, Body, Camera, GarmentMesh
from mocapflow.data import BODY, CLOTH, Cloth, FrameState, Pose, Surface
from mocapflow.geometry import kinematics, meshes, outfits, simplify
from mocapflow.geometry.angles import unmeasured
from mocapflow.memo import memoised
from mocapflow.records import F64, I32, U8, Bool, record

HEM_REACH = 0.15  # m from the garment, at rest: skin that its edge can come to cover or lay bare


@record
class Scene:
    """The cameras (pinhole) and the clothed person."""

    cameras: tuple[Camera, ...]
    body: Body
    garment: GarmentMesh | None = None
    background: Background | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the person and the clothes; also in run.json."""
        lacking = unmeasured(self.body.joint_names, whole=not self.body.cut.any())
        worn = () if self.garment is None else tuple(f"{self.garment.name}: {said}" for said in self.garment.repairs)
        return (f"body: {lacking}", *worn) if lacking else worn

    def with_background(self, background: Background | None) -> Scene:
        """Return the scene with the empty room known."""
        return replace(self, background=background)

    def simplified(self, faces: int) -> Scene:
        """Return the scene with a body of about so many faces if it has more, the garment pinned to the same places."""
        if len(self.body.faces) <= faces:
            return self
        body, garment = simplify.simplified(self.body, faces), self.garment
        if garment is not None:
            garment = outfits.pinned_anew(garment, self.body, body)
        return replace(self, body=body, garment=garment)

    @cached_property
    def pieces(self) -> tuple[Scene, ...]:
        """The person in each of the garments alone: of several that are worn as one each is draped by itself."""
        worn = () if self.garment is None else self.garment.pieces
        return tuple(replace(self, garment=piece) for piece in worn) or (self,)

    @cached_property
    def garment_index(self) -> I32:
        """To which of the garments that are worn each surface vertex (N,) belongs; -1: it is the body's."""
        counts = [0 if one.garment is None else len(one.garment.vertices) for one in self.pieces]
        return np.repeat(np.arange(-1, len(counts), dtype=np.int32), [len(self.body.vertices), *counts])

    @cached_property
    def faces(self) -> I32:
        """Faces of the whole surface, body first: (F, 3)."""
        if self.garment is None:
            return self.body.faces
        return np.concatenate([self.body.faces, self.garment.faces + np.int32(len(self.body.vertices))])

    @cached_property
    def edges(self) -> I32:
        """Edges of the whole surface: (E, 4), see `Surface.edges`."""
        return meshes.edges(self.faces)

    @cached_property
    def layer(self) -> U8:
        """Layer of each surface vertex, body first: (N,)."""
        cloth = 0 if self.garment is None else len(self.garment.vertices)
        return np.repeat(np.array([BODY, CLOTH], np.uint8), [len(self.body.vertices), cloth])

    @cached_property
    def held(self) -> Bool:
        """Which surface vertices (N,) the skin holds: its own, and those where the garment is pinned to it."""
        held: Bool = self.layer == BODY
        if self.garment is not None:
            held[len(self.body.vertices) + self.garment.pinned] = True
        return held

    @cached_property
    def hanging(self) -> F64:
        """How far (W,) m each garment vertex is from the pinned end of its strand, along the cloth."""
        if self.garment is None:
            return np.empty(0)
        return meshes.lengths_along(self.garment.vertices, self.garment.strands)

    @property
    def neutral_parameters(self) -> F64:
        """Parameters (Q,) of the garment without forces: zero, or the nearest to it within bounds."""
        return np.empty(0) if self.garment is None else np.clip(0.0, *self.garment.parameter_bounds.T)

    @cached_property
    def near_garment(self) -> Bool:
        """Which body vertices (V,) a garment covers or ends close to, by the rest pose."""
        return np.asarray(self._garment_at >= 0)

    @cached_property
    def covered(self) -> Bool:
        """Which surface vertices (N,) are skin that lies under the garment in the rest pose, not beyond its borders."""
        covered = np.zeros(len(self.layer), bool)
        if self.garment is not None:
            strands, border = self.garment.strands, np.zeros(len(self.garment.vertices), bool)
            border[strands[:, 0]] = border[strands[np.arange(len(strands)), (strands >= 0).sum(axis=1) - 1]] = True
            covered[: len(self.body.vertices)] = self.near_garment & ~border[self._garment_at]
        return covered

    @cached_property
    def _garment_at(self) -> I32:
        """The garment vertex nearest to each body vertex (V,) at rest; -1: none is near."""
        if self.garment is None:
            return np.full(len(self.body.vertices), -1, np.int32)
        from scipy.spatial import cKDTree

        away, nearest = cKDTree(self.garment.vertices).query(self.body.vertices, distance_upper_bound=HEM_REACH)
        return np.where(np.isfinite(away), nearest, -1).astype(np.int32)

    @cached_property
    def undressed(self) -> Scene:
        """The same scene without the garment."""
        return self if self.garment is None else replace(self, garment=None)

    def bare(self, surface: Surface) -> Surface:
        """Return the body of a surface without its cloth."""
        count = len(self.body.vertices)
        return replace(
            surface,
            vertices=surface.vertices[:count],
            faces=self.body.faces,
            edges=self.undressed.edges,
            layer=surface.layer[:count],
        )

    def surface(self, pose: Pose, cloth: Cloth) -> Surface:
        """Return body and garment posed in the world."""
        return _posed(pose, cloth, self)

    def surface_of(self, state: FrameState) -> Surface:
        """Return body and garment as a state has them."""
        return self.surface(state.estimate.pose, state.cloth)


@memoised
def _posed(pose: Pose, cloth: Cloth, scene: Scene) -> Surface:
    joints, screws = kinematics.chain(scene.body, pose)
    vertices = kinematics.skin(scene.body, joints, pose.angles)
    if len(cloth.vertices):
        vertices = np.concatenate([vertices, cloth.vertices])
    return Surface(
        vertices=vertices, faces=scene.faces, edges=scene.edges, layer=scene.layer, joints=joints, screws=screws
    )
