"""Cloth in newton's XPBD solver: B copies of one garment, each on its own body, stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mocapflow.records import F32, F64, I32, Bool
from mocapflow_physics.cloth import GRAVITY

SPEED = 12.0  # m/s, far above a knee pulled up within 0.3 s (2.7); between two looks for contacts less than REACH
REACH = 0.03  # m, nearer than this to the body a particle has a contact
FRICTION = 0.2  # of cloth on skin
SHARE = 0.2  # stiffness of a link in masses over squared steps: newton adds corrections up, more would overshoot
ITERATIONS = 1  # of the solver, a step: for the same time more steps come nearer to equilibrium than more iterations
PASSES = 20  # at the end, each laying what links pull into the body out of the part it is in
DAMPING_S = 0.1  # s in which speed falls to 1/e: near the critical damping of a hem that swings

Links = tuple[I32, F64, F64]  # as `cloth.links_of` gives them


class Simulation:
    """A garment as particles and springs; the model is built once, states and contacts are new for every drape."""

    def __init__(self, links: Links, pinned: Bool, copies: int, step: float) -> None:
        import warp

        warp.config.log_level = warp.LOG_ERROR  # it tells of every kernel it loads, on stdout
        import newton

        pairs, length, stiff = links
        count, springs = copies * len(pinned), copies * len(pairs)
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
        still = np.zeros((count, 3)).tolist()
        mass = np.tile(np.where(pinned, 0.0, 1.0), copies).tolist()
        builder.add_particles(pos=still, vel=still, mass=mass, radius=[0.0] * count)
        shifted = pairs[None] + len(pinned) * np.arange(copies)[:, None, None]
        builder.spring_indices.extend(shifted.ravel().tolist())
        builder.spring_rest_length.extend(np.tile(length, copies).tolist())
        builder.spring_stiffness.extend(np.tile(SHARE / step**2 * stiff, copies).tolist())
        builder.spring_damping.extend([0.0] * springs)
        builder.spring_control.extend([0.0] * springs)
        builder.add_shape_sphere(-1, radius=1e-3)  # contacts are found here; the solver asks a shape for its friction
        self._model: Any = builder.finalize(device="cpu")
        self._model.soft_contact_mu = FRICTION
        self._model.shape_material_mu.fill_(FRICTION)
        self._model.particle_max_velocity = SPEED
        self._solver: Any = newton.solvers.SolverXPBD(self._model, iterations=ITERATIONS)
        self._moved, self._step, self._damping = ~pinned, step, np.exp(-step / DAMPING_S)

    def settle(
        self,
        cloth: F64,
        pins: Sequence[F64],
        parts: Sequence[F64],
        values: F32,
        skin: F64,
        pull: F64,
        length: F64,
        every: int,
    ) -> F64:
        """Return the cloth (B, W, 3) m after it has been carried through a motion.

        Args:
            cloth: (B, W, 3) m, where it begins, at rest.
            pins: per moment (B, P, 3) m, where the pinned particles are.
            parts: per moment (B, P, COLUMNS), the bodies, as `mocapflow_draping.parts` tells.
            values: their voxels.
            skin: (B,) m, contact distance.
            pull: (B, W, 3) m/s^2, acceleration besides gravity.
            length: (B, K) m, rest lengths of the links.
            every: steps of the solver per moment.
        """
        import newton

        from mocapflow_physics.contacts import find_contacts

        self._model.spring_rest_length.assign(length.ravel().astype(np.float32))
        state, after = self._model.state(), self._model.state()
        contacts, control = newton.Contacts(0, cloth.shape[0] * cloth.shape[1], device="cpu"), self._model.control()
        contacts.soft_contact_shape.fill_(0)
        found = [contacts.soft_contact_particle, contacts.soft_contact_body_pos, contacts.soft_contact_normal]
        written = [array.numpy() for array in found]
        count = contacts.soft_contact_count.numpy()
        for one in (state, after):
            one.particle_q.numpy()[:] = cloth.reshape(-1, 3)
            one.particle_f.numpy()[:] = pull.reshape(-1, 3)
        for held, posed in zip(pins, parts, strict=True):
            place = state.particle_q.numpy().reshape(cloth.shape)
            place[:, ~self._moved] = held
            after.particle_q.numpy().reshape(cloth.shape)[:, ~self._moved] = held
            count[0] = find_contacts(place, self._moved, skin, REACH, posed, values, *written)
            for _ in range(every):
                self._solver.step(state, after, control, contacts, self._step)
                state, after = after, state
                state.particle_qd.numpy()[:] *= self._damping
        place = state.particle_q.numpy().reshape(cloth.shape)
        for _ in range(PASSES):
            out = find_contacts(place, self._moved, skin, 0.0, parts[-1], values, *written)
            place.reshape(-1, 3)[written[0][:out]] = written[1][:out]
        settled: F64 = place.astype(np.float64)
        return settled
