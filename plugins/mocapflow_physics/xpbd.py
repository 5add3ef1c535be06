"""Draper `xpbd`: cloth simulated by newton (extended position-based dynamics) instead of laid by geometry."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Annotated, ClassVar

from mocapflow_draping.forces import remaining_length, thickness
from mocapflow_draping.kinematic import Fitting, Kinematic
from mocapflow_draping.parts import posed_parts
from pydantic import Field, NonNegativeFloat, model_validator

from mocapflow.assets import GarmentMesh
from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.geometry.kinematics import chain_batch
from mocapflow.memo import memoised
from mocapflow.records import F64, I32, Bool
from mocapflow.scene import Scene
from mocapflow_physics.cloth import drawn_in, links_of, pinned_of, pins_at, pull_of
from mocapflow_physics.motion import beginning, between, centred
from mocapflow_physics.simulation import Simulation

MOVE = 0.3  # s in which the body comes from its last pose, or from rest
REST = 0.3  # s in which the cloth then comes to rest
EVERY = 2  # steps of the solver between two looks for contacts
KINEMATIC = Kinematic(sweeps=4)  # whose strands, distance fields and velocities are used


class Xpbd(Draper):
    """Lets the cloth fall in newton's XPBD solver while the body moves from its last pose into the new one.

    Velocities are those of the kinematic draper: differences of a simulation would cost a hundred of them a turn.
    """

    name: ClassVar[str] = "xpbd"
    skin_m: NonNegativeFloat = 0.005  # room between skin and cloth
    rate_hz: Annotated[float, Field(ge=60)] = 1920.0  # steps of the solver per second

    @model_validator(mode="after")
    def _simulator_is_there(self) -> Xpbd:
        if find_spec("newton") is None:
            raise ValueError("draper xpbd needs the simulator newton: pip install 'mocapflow[physics]'")
        return self

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        """Return cloth vertices (B, W, 3) m in the world for B poses and parameters (B, Q)."""
        garment = scene.garment
        assert garment is not None
        fitting = KINEMATIC.fitting(garment, scene.body)
        strands = fitting.strands
        root, centre = centred(scene, poses.root)
        end = PoseBatch(root=root, angles=poses.angles)
        start, cloth = beginning(past, scene, end)
        moving = max(round(MOVE * self.rate_hz / EVERY), 1)
        chains = [chain_batch(scene.body, moment) for moment in between(start, end, moving)]
        resting = 1 + round(REST * self.rate_hz / EVERY)
        parts = [posed_parts(fitting.fields, chain) for chain in chains]
        settled = _simulation(fitting, garment, len(cloth), 1 / self.rate_hz).settle(
            cloth,
            [pins_at(strands, chain) for chain in chains] + [pins_at(strands, chains[-1])] * resting,
            parts + [parts[-1]] * resting,
            fitting.fields.values,
            self.skin_m + thickness(garment, parameters),
            pull_of(strands, garment, parameters, chains[-1]),
            drawn_in(garment, remaining_length(garment, parameters)),
            EVERY,
        )
        return settled + centre[:, None]

    def velocity(self, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
        """Return the velocities (M, 3, 6 + D + Q) of cloth vertices (M,), taken from another draper."""
        return KINEMATIC.velocity(pose, parameters, vertices, past, scene)

    def touchable(self, scene: Scene) -> Bool:
        """Return which joints (J,) move what the garment hangs from or can touch."""
        return KINEMATIC.touchable(scene)


@memoised
def _simulation(fitting: Fitting, garment: GarmentMesh, copies: int, step: float) -> Simulation:
    """Return the simulation of so many copies of a garment that step together, `step` (s) at a time."""
    return Simulation(links_of(garment), pinned_of(fitting.strands, garment), copies, step)
