"""The trunk bends as one: what is seen of the back tells where the hidden pelvis is."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from mocapflow.assets import Body
from mocapflow.components import Prior
from mocapflow.data import Past, Pose, Residual
from mocapflow.memo import memoised
from mocapflow.scene import Scene
from mocapflow_priors.rows import whitened

LOWER, UPPER = "spine", "chest"  # the joints of the trunk


class SpineCoupling(Prior):
    """Holds the angles of the two joints of the trunk together, each with its namesake.

    The vertebrae share a bend; with clothes over the hips, the visible upper part of it says how the pelvis tilts.
    A body that lacks one of the joints has no such row.
    """

    name: ClassVar[str] = "spine_coupling"
    sd_deg: PositiveFloat = 3.0  # standard deviation between the two; 2.5 to 2.8 in walks, squats, kicks, jumps

    def residual(self, pose: Pose, past: Past, scene: Scene) -> Residual:
        """Return one row for each pair of angles of the same name."""
        pairs = _namesakes(scene.body)
        jacobian = np.zeros((len(pairs), 6 + len(pose.angles)))
        sharpness = 1.0 / np.radians(self.sd_deg)
        for row, (below, above) in enumerate(pairs):
            jacobian[row, 6 + below], jacobian[row, 6 + above] = sharpness, -sharpness
        return whitened(jacobian[:, 6:] @ pose.angles, jacobian)


@memoised
def _namesakes(body: Body) -> list[tuple[int, int]]:
    """Return the screws of the lower and of the upper joint that have the same name, e.g. flexion."""
    number = {name: index for index, name in enumerate(body.screw_names)}
    both = [(name, f"{UPPER}.{name.partition('.')[2]}") for name in body.screw_names]
    return [(number[a], number[b]) for a, b in both if a.startswith(f"{LOWER}.") and b in number]
