"""The next pose is the last one."""

from __future__ import annotations

from mocapflow.components import Predictor
from mocapflow.data import Frame, Past, Pose
from mocapflow.scene import Scene


class Hold(Predictor):
    """Guesses that nothing moved."""

    name = "hold"

    def predict(self, frame: Frame, past: Past, scene: Scene) -> Pose:
        """Return the last pose."""
        return past.moments[-1].pose
