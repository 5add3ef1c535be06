"""The kinematic draper: strands swing down onto the body, forces tilt them, rings hold them together."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import Field, PrivateAttr

from mocapflow.components import Draper
from mocapflow.data import Body, GarmentMesh, Past, PoseBatch
from mocapflow.errors import PluginError
from mocapflow.geometry.kinematics import chain_batch
from mocapflow.records import F64, record
from mocapflow.scene import Scene
from mocapflow_draping.fields import BodyFields, build_fields, part_transforms, touchable_joints
from mocapflow_draping.forces import tail_angles, thickness
from mocapflow_draping.strands import Strands, roots_and_facing, strands_of


@record
class Fitting:
    """A garment on a body, measured once for draping."""

    body: Body
    strands: Strands
    fields: BodyFields


class Kinematic(Draper):
    """Lays a garment by geometry alone: no mass, no time, no history.

    Source: Rosenhahn 2008, section 12.3.1
    """

    name: ClassVar[str] = "kinematic"
    skin_m: Annotated[float, Field(ge=0)] = 0.004  # room between skin and cloth of no thickness
    voxel_m: Annotated[float, Field(gt=0)] = 0.010
    start_deg: Annotated[float, Field(gt=0, lt=180)] = 95.0  # how far out from straight down a strand begins to fall
    _fittings: WeakKeyDictionary[GarmentMesh, Fitting] = PrivateAttr(default_factory=WeakKeyDictionary)

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return cloth vertices (B, W, 3) m in the world for B poses and parameters (B, Q)."""
        garment = scene.garment
        if garment is None:
            raise PluginError("the draper has no garment to drape", hint="name a garment in the pipeline's scene")
        fitting = self._fitting(garment, scene.body)
        strands = fitting.strands
        chain = chain_batch(scene.body, poses)
        roots, facing = roots_and_facing(strands, chain)
        stop = tail_angles(garment, parameters, strands.azimuth)
        skin = self.skin_m + thickness(garment, parameters) / 2
        draped = self._swing(fitting, chain, roots, facing, stop, skin)
        vertices = np.empty((len(chain), len(garment.vertices), 3))
        vertices[:, strands.vertex] = draped
        return vertices

    def _fitting(self, garment: GarmentMesh, body: Body) -> Fitting:
        """Return what is computed once per garment and body; forgotten with the garment."""
        known = self._fittings.get(garment)
        if known is None or known.body is not body:
            fields = build_fields(body, touchable_joints(body, garment), self.voxel_m)
            known = Fitting(body=body, strands=strands_of(garment, body), fields=fields)
            self._fittings[garment] = known
        return known

    def _swing(self, fitting: Fitting, chain: F64, roots: F64, facing: F64, stop: F64, skin: F64) -> F64:
        from mocapflow_draping.swing import swing_batch

        strands, fields = fitting.strands, fitting.fields
        out = np.empty((*roots.shape[:2], strands.vertex.shape[1], 3))
        support = np.empty(roots.shape[:2], np.int32)
        start = math.radians(self.start_deg)
        swing_batch(
            roots, facing, stop, start, skin, strands.links, strands.counts,
            part_transforms(fields, chain), fields.solid, out, support,
        )  # fmt: skip
        return out
