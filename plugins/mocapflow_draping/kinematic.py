"""The kinematic draper: strands swing down onto the body, forces tilt them, rings hold them together."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.assets import Body, GarmentMesh
from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.geometry.differences import all_columns, neighbours, tried_columns
from mocapflow.geometry.kinematics import chain_batch
from mocapflow.memo import memoised
from mocapflow.records import F64, I32, Bool, record
from mocapflow.scene import Scene
from mocapflow_draping.collisions import free_roots, free_strands
from mocapflow_draping.directions import along_limbs, skinned_strands, standing
from mocapflow_draping.drape_rates import Motion
from mocapflow_draping.drape_steps import body_rates, distinct, drape_strands, drape_with_rates, strand_starts
from mocapflow_draping.fields import BodyFields, build_fields, touchable_joints
from mocapflow_draping.forces import remaining_length, thickness, tilts, wind
from mocapflow_draping.parts import posed_parts, rates
from mocapflow_draping.strands import Strands, strands_of

TINY = 1e-6  # rad, and share of a parameter's range: what the drape starts from is differentiated by steps


@record
class Fitting:
    """A garment on a body, measured once for draping."""

    strands: Strands
    fields: BodyFields


class Kinematic(Draper):
    """Lays a garment by geometry alone: no mass, no time, no history.

    What touches the skin slides along it while rings close; by the literal rule it and what is taut above stay.
    Particles lie on the outer side of the cloth, where it is seen: its whole thickness off the skin.

    Source: Rosenhahn 2008, section 12.3
    """

    name: ClassVar[str] = "kinematic"
    skin_m: NonNegativeFloat = 0.005  # room between skin and cloth
    voxel_m: PositiveFloat = 0.010  # edge of a voxel of the body's distance fields
    rule: Literal["contact", "literal"] = "contact"  # from contact to contact; or in steps, as printed, a wind alone
    step_deg: PositiveFloat = 2.0  # literal: how far a particle turns in an iteration
    iterations: PositiveInt = 50  # literal: number of iterations
    limited: bool = False  # literal: stop at straight down instead of swinging about it
    pivot: Literal["strand", "space"] = "strand"  # literal: where the nearest fixed point is looked for
    sweeps: NonNegativeInt = 40  # passes over the rings of each row, at most; 0 leaves rings as they fell
    longest: Annotated[float, Field(ge=1)] = 1.0  # largest length of a ring link over its rest length
    stiff: Annotated[float, Field(ge=0, le=1)] = 0.3  # how much a ring resists being shortened
    bending_m: NonNegativeFloat = 0.06  # hanging: length along which a strand takes up a new direction
    hold_deg: Annotated[float, Field(gt=0, le=180)] = 45.0  # hanging: off the limb under it, before cloth sinks
    slips: Annotated[float, Field(gt=0, le=1)] = 0.3  # hanging: how much what lies gives way to what hangs beside it

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return cloth vertices (B, W, 3) m in the world for B poses and parameters (B, Q)."""
        garment = scene.garment
        assert garment is not None
        fitting = self.fitting(garment, scene.body)
        strands = fitting.strands
        skin = self.skin_m + thickness(garment, parameters)
        length = remaining_length(garment, parameters)
        kept, source = distinct(poses, skin, length)
        chain, skin = chain_batch(scene.body, PoseBatch(root=poses.root[kept], angles=poses.angles[kept])), skin[kept]
        links = length[kept, None, None] * strands.links
        parts = posed_parts(fitting.fields, chain)
        winds = tilts(garment, parameters, strands.azimuth)
        first = np.broadcast_to(strands.first, (len(source), len(strands.first)))
        if self.rule == "literal":
            force = wind(garment, parameters, chain[source, strands.carrier[0], :3, :3])
            grid, first = self._literal(fitting, chain, links, skin, parts, source, force)
        elif strands.skinned:
            grid = skinned_strands(strands, chain[source], links[source], *winds)
            free_roots(grid, strands.first, strands.last, parts[source], fitting.fields.values, None)
        else:
            starts = strand_starts(strands, chain, links)
            grid = drape_strands(strands, fitting.fields, starts, winds, source, skin, parts).grid
        if self.sweeps:
            self._close(fitting, grid, first, links[source], chain[source], skin[source], parts[source])
        return grid.reshape(len(grid), -1, 3)[:, strands.particle]

    def velocity(self, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
        """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,); contacts and taut links stay as they are."""
        if self.rule == "literal":
            return super().velocity(pose, parameters, vertices, past, scene)
        garment = scene.garment
        assert garment is not None
        tried = tried_columns(scene.body, self.touchable(scene), len(parameters))
        poses, values, steps = neighbours(tried, garment.parameter_bounds, pose, parameters, TINY, TINY)
        fitting = self.fitting(garment, scene.body)
        strands = fitting.strands
        chain = chain_batch(scene.body, poses)
        parts = posed_parts(fitting.fields, chain[-1:])
        skin = self.skin_m + thickness(garment, values)
        length = remaining_length(garment, values)
        links = length[:, None, None] * strands.links
        moved = body_rates(fitting.fields, chain, skin, length, steps)
        winds = tilts(garment, values, strands.azimuth)
        if strands.skinned:
            moved_strands = skinned_strands(strands, chain, links, *winds)
            grid, rate = moved_strands[-1:], rates(moved_strands, steps)
        else:
            starts = strand_starts(strands, chain, links)
            grid, rate = drape_with_rates(strands, fitting.fields, starts, winds, skin[-1:], parts, moved)
        motion = Motion(rate, np.zeros_like(rate), moved.part_rate, moved.skin_rate, moved.stretch_rate)
        if strands.skinned:
            free_roots(grid, strands.first, strands.last, parts, fitting.fields.values, motion)
        if self.sweeps:
            self._close(fitting, grid, strands.first[None], links[-1:], chain[-1:], skin[-1:], parts, motion)
        row, unknowns = strands.particle[vertices], 6 + len(pose.angles) + len(parameters)
        return all_columns(grid.reshape(-1, 3)[row], rate.reshape(-1, 3, len(steps))[row], tried, pose, unknowns)

    def touchable(self, scene: Scene) -> Bool:
        """Return which joints (J,) move what the garment hangs from or can touch."""
        assert scene.garment is not None
        fitting = self.fitting(scene.garment, scene.body)
        strands = fitting.strands
        touched = np.zeros(len(scene.body.parents), bool)
        touched[fitting.fields.joints] = True
        touched[strands.root_joint[strands.root_weight > 0]] = True
        touched[strands.skin_joint[strands.skin_weight > 0] if strands.skinned else strands.carrier] = True
        return touched

    def fitting(self, garment: GarmentMesh, body: Body) -> Fitting:
        """Return what is measured once per garment and body."""
        return _measured(body, garment, self.voxel_m)

    def _literal(
        self, fitting: Fitting, chain: F64, links: F64, skin: F64, parts: F64, source: I32, force: tuple[F64, F64]
    ) -> tuple[F64, I32]:
        """Return particles (B, N, L, 3) m as the chapter lays them, and the rows (B, N) that free ends hang from."""
        from mocapflow_draping.literal import blow_in_steps, settle_in_steps

        strands, values = fitting.strands, fitting.fields.values
        rows = strands.first, strands.last
        grid = standing(strands, chain, links)
        if strands.skinned:
            free_roots(grid, *rows, parts, values, None)
            free_strands(grid, links, *rows, skin, parts, values)
        fixed = np.zeros(grid.shape[:3], bool)
        fixed[:, np.arange(len(strands.first)), strands.first] = True
        turns = math.radians(self.step_deg), self.iterations, self.limited, self.pivot == "space"
        settle_in_steps(grid, fixed, *rows, skin, *turns, parts, values)
        grid, fixed = grid[source], fixed[source]
        return grid, blow_in_steps(grid, fixed, *rows, skin[source], *force, parts[source], values)

    def _close(
        self, fitting: Fitting, grid: F64, first: I32, links: F64, chain: F64, skin: F64, parts: F64,
        motion: Motion | None = None,
    ) -> None:  # fmt: skip
        """Close the rings, in place, of all that hangs below the rows `first` (B, N); those stay."""
        from mocapflow_draping.rings import close_batch

        strands = fitting.strands
        across, length = strands.spans
        bend, hold, slips = np.zeros_like(strands.links), math.pi, 1.0
        if self.bending_m > 0 and not strands.skinned:
            bend = np.exp(-strands.links / self.bending_m)
        if self.rule == "contact" and not strands.skinned:
            hold, slips = math.radians(self.hold_deg), self.slips
        close_batch(  # rows that may be written, always: each kind is compiled by itself
            grid, links, np.array(first, order="C"), strands.last, across, length, skin, self.longest, self.stiff,
            bend, along_limbs(strands, chain), hold, slips, self.sweeps, parts, fitting.fields.values, motion,
        )  # fmt: skip


@memoised
def _measured(body: Body, garment: GarmentMesh, voxel_m: float) -> Fitting:
    """Return a garment measured on a body, whose distance fields have voxels of an edge of `voxel_m`."""
    fields = build_fields(body, touchable_joints(body, garment), voxel_m)
    return Fitting(strands=strands_of(garment, body), fields=fields)
