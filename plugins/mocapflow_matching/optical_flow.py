"""Matcher `optical_flow`: where flow takes the points of the surface, between distance images or between frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, NonNegativeInt, PositiveFloat

from mocapflow.components import Matcher
from mocapflow.data import Frame, Matches, Past, Segmentation, Silhouette, Surface, Turn, empty_matches
from mocapflow.geometry import silhouettes
from mocapflow.pooling import pool, weighted
from mocapflow.records import F32, F64, Bool
from mocapflow.scene import Scene
from mocapflow_matching.flow_points import CLOTH_SHARE, distances, flow_points
from mocapflow_matching.robust import robust_precision
from mocapflow_matching.shape_flow import register
from mocapflow_matching.uncertainty import HEM_GUARD_PX, contour_sigma

WORKING_SIDE = 200  # px, at most, of the distance images: they are smooth
SMOOTHNESS = 3.0  # weight of the flow's smoothness against the difference of the distance images
BAND = 0.1  # half width of the band about the model's contour, share of the picture's longer side
LEVELS = 3  # of the pyramid of distance images
ON_CONTOUR = 1.0  # px from the image contour within which a target has to end
LATER_SHARE = 0.25  # of points followed, after the turns in which shapes are registered: 0.2 to contour_icp's 0.8
CONTOUR_SIGMA_PX = 1.0  # standard deviation of a pair of contour points on skin


class OpticalFlow(Matcher):
    """Pairs by flow, to be pooled with those of `contour_icp`.

    `shapes`: the flow that registers the model's distance image with the silhouette's takes each contour point of
    the model to its target; it reaches further than the nearest neighbour, above all for shifts. It leads the way in
    the first turns only: later it would hold a limb on the wrong part of the outline. `frames`: points tracked from
    the frame before (stage `flow`) that lie on the surface as it was found there. They see what no contour shows, as
    turns of a limb about itself, but add up their errors over frames; on cloth they follow the cloth, which slides
    over the skin.
    """

    name = "optical_flow"
    between: Literal["both", "shapes", "frames"] = "both"  # model and image of a frame (shapes), two frames, or both
    first_turns: NonNegativeInt = 1  # turns at the beginning of a frame in which shapes are registered
    first_share: NonNegativeFloat = 2.3  # weight in these turns, where contour_icp's is 1
    spacing_px: PositiveFloat = 4.0  # between the points of the model's contour
    cloth_sigma_px_per_m: PositiveFloat = 80.0  # as for contour_icp
    image_sigma_px: PositiveFloat = 1.5  # standard deviation of a tracked point
    scale: PositiveFloat = 2.0  # standard deviations beyond which a pair pulls no harder (Huber)

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return the pairs of every view; see the class."""
        first = turn.index < self.first_turns
        parts = []
        if self.between != "shapes":
            parts.append(self.carried(frame, surface, past, scene))
        if self.between != "frames" and first:
            parts += [self.registered(silhouette, surface, scene) for silhouette in segmentation.of("person")]
        return weighted(pool(parts), self.first_share if first else LATER_SHARE)

    def carried(self, frame: Frame, surface: Surface, past: Past, scene: Scene) -> Matches:
        """Return the pairs by flow between frames."""
        matches = flow_points(frame, past, scene)
        away = distances(matches, surface, scene)
        weight = robust_precision(away, self.image_sigma_px, "huber", self.scale)
        return replace(matches, weight=weight * np.where(surface.cloth[matches.vertex], CLOTH_SHARE, 1.0))

    def registered(self, silhouette: Silhouette, surface: Surface, scene: Scene) -> Matches:
        """Return the pairs of one view by flow between distance images."""
        camera = scene.cameras[silhouette.camera]
        model = silhouettes.occluding_contour(surface, camera, self.spacing_px)
        if not len(model.pixel):  # it has left the view
            return empty_matches()
        shrink = int(np.ceil(camera.size.max() / WORKING_SIDE))
        covered, shown = silhouettes.covered(surface, camera), silhouette.distance > 0
        here, there = (silhouettes.mask_distance(_shrunk(mask, shrink)) for mask in (covered, shown))
        flow = register(here, there, SMOOTHNESS, LEVELS, BAND * max(here.shape))
        middle = (shrink - 1) / 2  # pixel centres are on integers in both sizes
        small = (model.pixel - middle) / shrink
        target = shrink * _snapped(small + _sampled(flow, small), there) + middle
        target = _snapped(target, silhouette.distance)
        on = np.abs(_sampled(silhouette.distance, target)) < ON_CONTOUR
        away = np.linalg.norm(target - model.pixel, axis=1)
        sigma = contour_sigma(model, surface, scene, CONTOUR_SIGMA_PX, self.cloth_sigma_px_per_m, HEM_GUARD_PX)
        return Matches(
            camera=np.full(int(on.sum()), silhouette.camera, np.int16),
            pixel=(target - (model.pixel - model.anchor))[on],
            direction=np.zeros((int(on.sum()), 2)),
            vertex=model.vertex[on],
            weight=robust_precision(away, sigma, "huber", self.scale)[on],
        )


def _shrunk(mask: Bool, factor: int) -> Bool:
    """Return a mask at one over `factor` of its size, cut to whole pixels."""
    import cv2

    height, width = (side // factor for side in mask.shape)
    whole = mask[: height * factor, : width * factor].astype(np.float32)
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA) > 0.5)


def _sampled(field: F32, points: F64) -> F64:
    """Return the values of a field (H, W) or (H, W, 2) at points (K, 2) px, linear between pixels."""
    import cv2

    x, y = np.ascontiguousarray(points.T[:, None], np.float32)
    values = cv2.remap(field, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values[0], np.float64)


def _snapped(points: F64, distance: F32) -> F64:
    """Return points (K, 2) px after one step down a distance image (H, W); where it is flat they stay."""
    shifts = 0.5 * np.eye(2)
    slope = np.stack([_sampled(distance, points + s) - _sampled(distance, points - s) for s in shifts], axis=1)
    square = np.sum(slope**2, axis=1, keepdims=True)
    step = _sampled(distance, points)[:, None] * slope / np.maximum(square, 0.25)
    return np.asarray(points - step)
