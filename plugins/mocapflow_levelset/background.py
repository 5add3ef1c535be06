"""The simple segmenter: what differs from the empty scene and is not its shadow is the person."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat

from mocapflow.assets import Background
from mocapflow.data import Frame, FrameState, Past, Segmentation, Silhouette, Turn
from mocapflow.errors import RecordingError
from mocapflow.geometry.silhouettes import distance_to, model_distance
from mocapflow.records import F32, U8, Bool
from mocapflow.scene import Scene
from mocapflow_levelset.channels import ChannelName, features
from mocapflow_levelset.evidence import Room, smoothed
from mocapflow_levelset.evolve import Schedule, Weights
from mocapflow_levelset.levelset import INNER_BAND_PX, RATIO_CLIP
from mocapflow_levelset.masks import counted
from mocapflow_levelset.plates import Plate, Shadow, density_image, plate_in
from mocapflow_levelset.shadows import ShadowAware, shadowed
from mocapflow_levelset.statistics import Window
from mocapflow_levelset.view import BAND_PX, Method, Resolution, View, find

CHANNELS: tuple[ChannelName, ...] = ("lab",)
SMOOTH_PX = 1.0  # of the evidence before it is cut
REFINE_STEPS = 4  # against the plate, then as many with local statistics on both sides
HOLE_PX2 = 120  # area up to which holes are filled
SMALLEST_PART = 0.01  # of the largest part's area; smaller parts are noise
METHOD = Method(  # of the refinement
    channels=CHANNELS,
    weights=Weights(sigma_px=1.5, length=0.5, shape=0.0, clip=RATIO_CLIP, step=1.0, band_px=INNER_BAND_PX),
    decorrelate=False,
    stride=2,
    margin_px=40,
)


class BackgroundDifference(ShadowAware):
    """Difference to the empty scene: a neutral, limited darkening is a shadow, any other change the person.

    The boundary is then refined to sub-pixels by a few level-set steps, the person's colours against the plate.
    """

    name: ClassVar[str] = "background"
    needs_background: ClassVar[bool] = True

    reach_px: NonNegativeFloat = 60.0  # parts further from the projected model than this are someone else; 0: keep all

    def segment(self, frame: Frame, state: FrameState, past: Past, scene: Scene, turn: Turn) -> Segmentation:
        """Return the person's silhouette in each usable view.

        Raises:
            RecordingError: the scene's background is not known.
        """
        if scene.background is None:
            raise RecordingError(
                "the segmenter 'background' needs the empty scene, and none is known",
                hint="put the stage 'background' before 'track', or choose the segmenter 'levelset'",
            )
        surface = scene.surface_of(state)
        silhouettes = []
        for c, camera in enumerate(scene.cameras):
            if not frame.usable[c]:
                continue
            model = model_distance(surface, camera, BAND_PX)
            floor = shadowed(frame, surface, scene, c)
            distance = self.find(frame.images[c], model, floor, scene.background, c, frame.hidden_in(c))
            silhouettes.append(Silhouette(camera=c, layer="person", distance=distance))
        return Segmentation(silhouettes=tuple(silhouettes))

    def find(
        self, image: U8, model: F32, floor: Bool, background: Background, camera: int, hidden: Bool | None = None
    ) -> F32:
        """Return the signed distance (H, W) px to the person's outline in one image.

        Args:
            image: (H, W, 3) BGR.
            model: (H, W) px, signed distance to the projected model's outline; only tells the person from others.
            floor: (H, W) True where a shadow may fall.
            background: the empty scene.
            camera: which of its views.
            hidden: (H, W) True where the picture shows nothing of the person; None: nowhere.
        """
        plate, shadow = plate_in(background, camera, CHANNELS), self.shadow(image, background, camera)
        start = self._start(image, model, plate, floor, shadow, hidden)
        view = View(image, start, start, counted(start.shape, 0, hidden), {1: Room(plate, floor, shadow, SMOOTH_PX)})
        against_plate = Resolution(1, Schedule(REFINE_STEPS, 3, 3), Window(12.0, 8, 0.02))
        return find(view, [against_plate, against_plate._replace(use_plate=False)], METHOD).level

    def _start(self, image: U8, model: F32, plate: Plate, floor: Bool, shadow: Shadow, hidden: Bool | None) -> F32:
        """Return a level set (H, W), not a distance: positive where the image is unlike the plate."""
        import cv2

        values = features(smoothed(image, SMOOTH_PX), CHANNELS)
        density = density_image(values, plate, floor, CHANNELS, shadow)
        unknown, bounded = np.isnan(density), np.nan_to_num(np.clip(-density, -RATIO_CLIP, RATIO_CLIP))
        change = cv2.GaussianBlur(bounded, (0, 0), SMOOTH_PX)
        untold = unknown if hidden is None else unknown | hidden
        change[untold] = np.clip(model[untold], -1, 1)  # nothing else tells
        kept = self._person(change > 0, model)
        return np.where(kept, np.maximum(change, 0.1), np.minimum(change, -0.1)).astype(np.float32)

    def _person(self, changed: Bool, model: F32) -> Bool:
        """Return the changed parts that are large and near the model, their small holes filled."""
        import cv2

        filled = cv2.morphologyEx(changed.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        count, label, stats, _ = cv2.connectedComponentsWithStats(filled, connectivity=4)
        area = stats[:, cv2.CC_STAT_AREA].astype(float)
        area[0] = 0
        if self.reach_px and (model > 0).any():
            away = distance_to(model > 0)
            near = np.unique(label[away <= self.reach_px])
            area[np.setdiff1d(np.arange(count), near)] = 0
        person = (area >= max(SMALLEST_PART * area.max(), 1))[label]
        count, label, stats, _ = cv2.connectedComponentsWithStats((~person).astype(np.uint8), connectivity=8)
        whole = stats[:, cv2.CC_STAT_AREA]
        within = np.bincount(label.ravel(), weights=(model > 0).ravel(), minlength=count)
        small = (whole <= HOLE_PX2) | (within > 0.8 * whole)  # the model says where the body has no hole
        kept: Bool = person | small[label]
        return kept
