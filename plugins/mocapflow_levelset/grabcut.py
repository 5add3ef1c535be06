"""cv2.grabCut as a segmenter: the usual alternative, for comparison."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import PositiveInt

from mocapflow.components import Segmenter
from mocapflow.data import Frame, FrameState, Past, Segmentation, Silhouette, Turn
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.records import F32, U8, Bool
from mocapflow.scene import Scene
from mocapflow_levelset import crops
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.view import BAND_PX

UNSURE_PX = 15.0  # half width of the band that is left to the cut
MARGIN_PX = 60  # of the crop around the model


class GrabCut(Segmenter):
    """Colour mixtures and a graph cut; certain outside and inside a band around the projected model.

    Its contour is that of a mask, so it is only good to about half a pixel.
    """

    name: ClassVar[str] = "grabcut"

    iterations: PositiveInt = 2  # iterations of the graph cut

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the person's silhouette in each usable view."""
        surface = scene.surface_of(state)
        silhouettes = []
        for c, camera in enumerate(scene.cameras):
            if not frame.usable[c]:
                continue
            distance = self.find(frame.images[c], model_distance(surface, camera, UNSURE_PX + 1), frame.hidden_in(c))
            silhouettes.append(Silhouette(camera=c, layer="person", distance=distance))
        return Segmentation(silhouettes=tuple(silhouettes))

    def find(self, image: U8, model: F32, hidden: Bool | None = None) -> F32:
        """Return the signed distance (H, W) px to the person's outline, from the model's signed distance (H, W).

        Where the person is hidden (H, W) it is the model's.
        """
        import cv2

        distance = np.full(model.shape, -BAND_PX, np.float32)
        crop = crops.around(model, MARGIN_PX, 1)
        if crop is None:
            return distance
        near = crop.of(model)
        labels = np.where(near > 0, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
        labels[near > UNSURE_PX] = cv2.GC_FGD
        labels[near < -UNSURE_PX] = cv2.GC_BGD
        if self._decidable(labels):
            mixtures = np.zeros((1, 65)), np.zeros((1, 65))
            cv2.setRNGSeed(0)  # the mixtures start from random clusters; a run must repeat exactly
            picture = np.ascontiguousarray(crop.of(image))
            cv2.grabCut(picture, labels, None, *mixtures, self.iterations, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
        person = (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)
        if hidden is not None:
            person = np.where(crop.of(hidden), near > 0, person)
        crop.of(distance)[:] = redistance(np.where(person, np.float32(1), np.float32(-1)), BAND_PX)
        return distance

    def _decidable(self, labels: U8) -> bool:
        """True where both regions have pixels to learn colours from."""
        import cv2

        inside = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
        return bool(inside.any() and not inside.all())
