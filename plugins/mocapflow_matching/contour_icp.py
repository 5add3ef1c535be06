"""Matcher `contour_icp`: nearest neighbours between image contours and the occluding contour of the model."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numba
import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from mocapflow.components import Matcher
from mocapflow.data import Contour, Frame, Matches, Past, Segmentation, Silhouette, Surface, Turn
from mocapflow.geometry.contours import pairs
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.memo import memoised
from mocapflow.pooling import pool
from mocapflow.records import F64, I32, Bool
from mocapflow.scene import Scene
from mocapflow.settings import PositiveOrInf
from mocapflow_matching.camouflage import without_camouflaged
from mocapflow_matching.robust import Loss, robust_precision
from mocapflow_matching.uncertainty import HEM_GUARD_PX, contour_sigma

FAR_CALM_MM = 15.0  # stands for `calm_mm`, if less, in a frame that began far off


class ImageContour(NamedTuple):
    """Points of the image contour (K,) sorted by row: pixels, unit normals outward, curvature where it is known."""

    pixel: F64
    normal: F64
    curvature: F64


class ModelContour(NamedTuple):
    """Points of the model's contour sorted by row, and their curvature (K,) where it is known."""

    contour: Contour
    curvature: F64


class ContourIcp(Matcher):
    """Forward pairs (image contour to nearest model contour) and backward pairs, in every view.

    All components of the contours take part, holes too. While the body still moves by more than `calm_mm` a turn,
    the reach is wide and the loss `first_loss`; then narrow and `later_loss`: a redescending loss helps only once the
    pose is nearly right, before that it gives up the limb that is furthest off.
    """

    name = "contour_icp"
    direction: Literal["both", "forward", "backward"] = "both"  # image to model, model to image, or both
    residual: Literal["normal", "point"] = "normal"  # let points slide along the contour, or not (the chapter)
    spacing_px: PositiveFloat = 4.0  # between the points of a contour
    hem_guard_px: NonNegativeFloat = HEM_GUARD_PX  # skin so near to cloth counts as cloth: a hem is uncertain
    calm_mm: PositiveFloat = 15.0  # change of the body in a turn below which `later_reach_px` and `later_loss` hold
    first_reach_px: PositiveFloat = 40.0  # pairs farther apart are left out at first
    later_reach_px: PositiveFloat = 10.0  # pairs farther apart are left out once the body is calm
    cloth_reach_px: PositiveOrInf = float("inf")  # pairs on cloth reach no farther: a hem that swings turns the pelvis
    normal_angle_deg: Annotated[float, Field(gt=0, le=180)] = 60.0  # contours that differ by more make no pair
    first_loss: Loss = "huber"  # loss of a pair by its distance, at first
    later_loss: Loss = "geman_mcclure"  # loss of a pair once the body is calm
    normal_px: NonNegativeFloat = 0.0  # weight of normals in pairing: those at right angles are sqrt 2 times this apart
    scale: PositiveFloat = 2.0  # standard deviations at which the loss begins to give way
    sigma_px: PositiveFloat = 1.0  # standard deviation of a pair on skin
    cloth_sigma_px_per_m: NonNegativeFloat = 80.0  # added on cloth, per metre of it above: a drape is less sure

    @property
    def stride(self) -> int:
        """How many zero crossings to go on for the spacing: there are 4/pi of them per pixel of contour.

        They come row by row. A step that shares a factor with the number of contours in a row, two for a limb, would
        take some of them again and again and the others never; so it has neither 2 nor 3 for a factor.
        """
        wanted = self.spacing_px * 4 / np.pi
        steps = (step for step in range(1, int(2 * wanted) + 6) if step % 2 and step % 3)
        return min(steps, key=lambda step: abs(step - wanted))

    def match(
        self, frame: Frame, segmentation: Segmentation, surface: Surface, past: Past, scene: Scene, turn: Turn
    ) -> Matches:
        """Return pairs of contour points; see the class."""
        views = [self.match_view(s, surface, scene, turn) for s in segmentation.of("person")]
        return without_camouflaged(pool(views), past)

    def match_view(self, silhouette: Silhouette, surface: Surface, scene: Scene, turn: Turn) -> Matches:
        """Return the pairs of one view."""
        image, (model, curvature) = self.contours(silhouette, surface, scene, turn)
        reach = self.later_reach_px if self._calm(turn) else self.first_reach_px
        cosine = float(np.cos(np.radians(self.normal_angle_deg)))
        one = self.descriptors(*image)
        other = self.descriptors(model.pixel, model.normal, curvature)
        forward, backward = self.direction != "backward", self.direction != "forward"  # image to model; model to image
        image_row, model_row = pairs(one, image.normal, other, model.normal, reach, cosine, forward, backward)
        if reach > self.cloth_reach_px:
            kept = self.within_reach(image.pixel.take(image_row, axis=0), model, model_row, surface)
            image_row, model_row = image_row[kept], model_row[kept]
        if scene.body.cut.any():  # there the person goes on although the model ends
            goes_on = np.isin(model.vertex, np.flatnonzero(scene.body.cut)).take(model_row)
            image_row, model_row = image_row[~goes_on], model_row[~goes_on]
        guard = self.hem_guard_px
        sigma = contour_sigma(model, surface, scene, self.sigma_px, self.cloth_sigma_px_per_m, guard)
        return self.weigh(silhouette.camera, image, model, image_row, model_row, sigma, turn)

    def within_reach(self, pixel: F64, model: Contour, model_row: I32, surface: Surface) -> Bool:
        """Return which pairs (M,) of image points (M, 2) px and model points are on skin, or near enough for cloth."""
        away = np.linalg.norm(pixel - model.pixel.take(model_row, axis=0), axis=1)
        return np.asarray((away <= self.cloth_reach_px) | ~surface.cloth.take(model.vertex.take(model_row)))

    def _calm(self, turn: Turn) -> bool:
        return turn.calm(min(self.calm_mm, FAR_CALM_MM) if turn.far else self.calm_mm)

    def contours(
        self, silhouette: Silhouette, surface: Surface, scene: Scene, turn: Turn
    ) -> tuple[ImageContour, ModelContour]:
        """Return the contours of one view that are to be paired."""
        model = occluding_contour(surface, scene.cameras[silhouette.camera], self.spacing_px)
        return image_contour(silhouette, self.stride), ModelContour(model, np.zeros(len(model.pixel)))

    def descriptors(self, pixel: F64, normal: F64, curvature: F64) -> F64:
        """Return what points (K,) are compared by, in px: their place first, then features."""
        return np.column_stack([pixel, self.normal_px * normal]) if self.normal_px else pixel

    def weigh(
        self, index: int, image: ImageContour, model: Contour, image_row: I32, model_row: I32, sigma: F64, turn: Turn
    ) -> Matches:
        """Return pairs (M,) of rows of image and model contour; points of the model's (K,) have errors `sigma` px."""
        slides = self.residual == "normal"
        pixel, direction, vertex, spread, distance = paired_points(
            image_row, model_row, image.pixel, image.normal, model.pixel, model.anchor, model.vertex, sigma, slides
        )
        loss = self.later_loss if self._calm(turn) else self.first_loss
        return Matches(
            camera=np.full(len(image_row), index, np.int16),
            pixel=pixel,
            direction=direction,
            vertex=vertex,
            weight=robust_precision(distance, spread, loss, self.scale),
        )


@memoised
def image_contour(silhouette: Silhouette, stride: int) -> ImageContour:
    """Return every so many-th point of the contour of a silhouette."""
    pixel, normal = (np.ascontiguousarray(rows[::stride]) for rows in silhouette.zero_level)
    return ImageContour(pixel, normal, np.zeros(len(pixel)))


@numba.njit(cache=True)
def paired_points(image_row, model_row, pixel, normal, drawn, anchor, vertex, sigma, slides):  # type: ignore[no-untyped-def]
    """Return target, direction, vertex, standard deviation and distance of pairs (M,); see `ContourIcp.weigh`.

    A model point lies between vertices: moving the target by as much makes the vertex stand for it.
    """
    count = len(image_row)
    target, direction, end = np.empty((count, 2)), np.zeros((count, 2)), np.empty(count, np.int32)
    spread, distance = np.empty(count), np.empty(count)
    for m in range(count):
        s, k = image_row[m], model_row[m]
        dx, dy = drawn[k, 0] - pixel[s, 0], drawn[k, 1] - pixel[s, 1]
        target[m, 0], target[m, 1] = anchor[k, 0] - dx, anchor[k, 1] - dy
        end[m], spread[m] = vertex[k], sigma[k]
        if slides:
            direction[m, 0], direction[m, 1] = normal[s, 0], normal[s, 1]
            distance[m] = abs(dx * normal[s, 0] + dy * normal[s, 1])
        else:
            distance[m] = np.sqrt(dx * dx + dy * dy)
    return target, direction, end, spread, distance
