"""Poses like those people were seen in: a Parzen density of joint angles as extra equations."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from mocapflow.assets import Body
from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.memo import memoised
from mocapflow.scene import Scene
from mocapflow_priors.density import Density, Poses, log_density, read

SHIPPED = Path(__file__).parent / "data" / "motions.npz"  # walks, squats, raised knees, jumps, kicks, crossed legs


class Parzen(Prior):
    """Draws the joint angles towards the training poses near them; limbs that no camera sees come to rest there.

    One row an angle, a full step to the weighted mean of the training poses. In units of the bandwidth these rows
    bound -log p from above, so a step that lowers their sum of squares lowers -log p.

    Source: Rosenhahn 2008, section 12.5.1
    """

    name: ClassVar[str] = "parzen"
    poses: Poses = SHIPPED  # file made by `mocapflow prior fit`; leave out the take that is tracked

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row for each trained angle the body has; the energy is -log p above the least it can be."""
        density, screws = _known(scene.body, self.density)
        sharpness = 1 / density.bandwidth
        log_p, mean = log_density(density, pose.angles[screws])
        jacobian = np.zeros((len(screws), 6 + len(pose.angles)))
        jacobian[np.arange(len(screws)), 6 + screws] = sharpness
        error = sharpness * (pose.angles[screws] - mean)
        return Residual(error=error, jacobian=jacobian, energy=density.peak - log_p)

    @cached_property
    def density(self) -> Density:
        """The training poses."""
        return read(self.poses)


@memoised
def _known(body: Body, density: Density) -> tuple[Density, npt.NDArray[np.intp]]:
    """Return the density of the angles that a body has, and their screws (K,)."""
    screws = [k for k, name in enumerate(body.screw_names) if name in density.names]
    return density.of([body.screw_names[k] for k in screws]), np.array(screws, np.intp)
