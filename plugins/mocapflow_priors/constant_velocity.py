"""The next pose follows from the last two."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mocapflow.components import Predictor
from mocapflow.data import Frame, Past, Pose
from mocapflow.scene import Scene
from mocapflow_priors.extrapolate import ahead, continued


class ConstantVelocity(Predictor):
    """Guesses that the motion goes on as it was, over the time that really passed."""

    name = "constant_velocity"

    kept: Annotated[float, Field(ge=0, le=1)] = 1.0  # share of the velocity that lasts; less holds back a jumpy track

    def predict(self, frame: Frame, past: Past, scene: Scene) -> Pose:
        """Return the last pose moved on to the time of the frame; the last pose itself if there is only one."""
        return continued(past, self.kept * ahead(frame, past))
