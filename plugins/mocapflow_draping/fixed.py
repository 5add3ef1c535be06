"""The cloth fitter that fits nothing: the garment is draped with the parameters it was given."""

from __future__ import annotations

from typing import ClassVar

from mocapflow.components import ClothFitter
from mocapflow.data import Cloth, Estimate, Frame, Past, Segmentation, Turn
from mocapflow.model import ClothedModel


class Fixed(ClothFitter):
    """Drapes the garment at the estimated pose with the estimated parameters; no cloth without a garment."""

    name: ClassVar[str] = "fixed"

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the garment draped at the estimated pose."""
        return model.drape(estimate.pose, estimate.parameters, past)
