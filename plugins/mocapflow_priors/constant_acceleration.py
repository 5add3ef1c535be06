"""The next pose follows from the last three."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mocapflow.components import Predictor
from mocapflow.data import Frame, Past, Pose
from mocapflow.scene import Scene
from mocapflow_priors.extrapolate import ahead, continued


class ConstantAcceleration(Predictor):
    """Guesses that the motion goes on as it was, and a share of its change, over the time that really passed.

    All of the change would be a guess as poor as none: it is measured from three poses, each with its own error.
    """

    name = "constant_acceleration"

    kept: Annotated[float, Field(ge=0, le=1)] = 0.4  # share of the acceleration that lasts

    def predict(self, frame: Frame, past: Past, scene: Scene) -> Pose:
        """Return the last pose moved on to the time of the frame; by its velocity alone if there are but two."""
        return continued(past, ahead(frame, past), self.kept)
