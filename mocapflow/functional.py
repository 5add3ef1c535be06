"""The functional of section 12.4, term by term and view by view, and steps that do not raise it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mocapflow.assets import Camera
from mocapflow.components import Prior
from mocapflow.data import Cloth, Estimate, FrameState, Matches, Past, Pose, Segmentation, Silhouette, Surface
from mocapflow.geometry import silhouettes
from mocapflow.geometry.cameras import project_each
from mocapflow.guards.outputs import residual_of
from mocapflow.model import ClothedModel, increment_between, moved
from mocapflow.records import F32, F64

SHAPE_WEIGHT = 0.05  # lambda, px^-2; a segmenter may descend with another one
BAND_PX = 12.0  # around both contours, at most; beyond, the area term does not grow
SLACK = 0.01  # share that area and priors may rise by in a step: what a step lowers is the error of contours
IN_VIEW = ("data", "length", "shape", "contour")  # contour: what the pose solver lowers; not part of the sum
SHAPE, CONTOUR = IN_VIEW.index("shape"), IN_VIEW.index("contour")  # the columns that hold for any segmenter


@dataclass(frozen=True)
class Functional:
    """What a state costs: per view the regions' data and length and the area between model and silhouette; priors."""

    model: ClothedModel
    priors: Sequence[Prior]
    past: Past

    @cached_property
    def terms(self) -> tuple[str, ...]:
        """The names (E,) of the terms: view and term, then the priors."""
        views = [f"{camera.name}.{term}" for camera in self.model.scene.cameras for term in IN_VIEW]
        return (*views, *unique_names([prior.name for prior in self.priors]))

    def values(self, state: FrameState) -> F64:
        """Return the terms (E,) of a state; NaN where a view is not seen or has no such energy.

        Source: Rosenhahn 2008, section 12.4
        """
        surface, cameras = self.model.scene.surface_of(state), self.model.scene.cameras
        said = state.segmentation.energies
        views = np.array([[said.get(f"{camera.name}.{term}", np.nan) for term in IN_VIEW] for camera in cameras])
        matched = contours(surface, state.matches, cameras)
        for silhouette in state.segmentation.of("person"):
            c = silhouette.camera
            views[c, SHAPE], views[c, CONTOUR] = area(surface, silhouette, cameras[c]), matched[c]
        return np.concatenate([views.ravel(), self._priors(state.estimate.pose)])

    def total(self, values: F64) -> float:
        """Return the sum of terms (E,), without those that a view or a segmenter lacks and the error of contours."""
        counted = [not name.endswith(".contour") for name in self.terms]
        return float(np.nansum(values[counted]))

    def pose_cost(self, segmentation: Segmentation, pose: Pose, cloth: Cloth) -> float:
        """Return the terms that pose and cloth can change, summed: area and priors."""
        surface, cameras = self.model.surface(pose, cloth), self.model.scene.cameras
        areas = [area(surface, silhouette, cameras[silhouette.camera]) for silhouette in segmentation.of("person")]
        return sum(areas) + sum(self._priors(pose))

    def step(
        self, state: FrameState, segmentation: Segmentation, estimate: Estimate, cloth: Cloth, halvings: int
    ) -> tuple[Estimate, Cloth]:
        """Return the new estimate and cloth; while they cost more than the state's, the step to them is halved."""
        if not halvings:
            return estimate, cloth
        most = (1 + SLACK) * self.pose_cost(segmentation, state.estimate.pose, state.cloth)
        for _ in range(halvings):
            if self.pose_cost(segmentation, estimate.pose, cloth) <= most:
                break
            pose = halfway(state.estimate.pose, estimate.pose)
            cloth = self.model.drape(pose, (state.cloth.parameters + cloth.parameters) / 2, self.past)
            estimate = replace(estimate, pose=pose, parameters=cloth.parameters)
        return estimate, cloth

    def _priors(self, pose: Pose) -> list[float]:
        return [prior.weight * residual_of(prior, pose, self.past, self.model.scene).energy for prior in self.priors]


def image_cost(energy: F64, terms: Sequence[str]) -> float:
    """Return what the silhouettes of a frame's last turn cost by the images, data and length: less is better.

    Not by the area between model and silhouette, most of which is that of cloth laid wrong, whatever the pose.

    Args:
        energy: (U, E) terms of the functional after each turn; NaN after the last.
        terms: their E names.
    """
    summed = [name.endswith((".data", ".length")) for name in terms]
    turns = energy[np.isfinite(energy).any(axis=1)]
    return float(np.nansum(turns[-1:, summed]))


def area(surface: Surface, silhouette: Silhouette, camera: Camera) -> float:
    """Return the shape term of a view: the squared difference of the two distance fields, within the band."""
    model = silhouettes.model_distance(surface, camera, band := _band(silhouette.distance))
    return SHAPE_WEIGHT * silhouettes.squared_difference(model, silhouette.distance, band)


def _band(distance: F32) -> float:
    """Return the half width of the band to compare in: a segmenter may keep a narrower one than ours."""
    if abs(distance[0, 0]) >= BAND_PX:  # nearly always: nothing has to be looked through
        return BAND_PX
    return min(BAND_PX, float(max(distance.max(), -distance.min())))


def contours(surface: Surface, matches: Matches, cameras: Sequence[Camera]) -> F64:
    """Return half the weighted squared error of the matches of each view (C,)."""
    off = project_each(surface.vertices.take(matches.vertex, axis=0), matches.camera, cameras) - matches.pixel
    along = np.einsum("ma,ma->m", off, matches.direction) ** 2
    squared = np.where(matches.direction.any(axis=1), along, np.einsum("ma,ma->m", off, off))
    return np.bincount(matches.camera, 0.5 * matches.weight * squared, minlength=len(cameras)).astype(np.float64)


def overlaps(surface: Surface, segmentation: Segmentation, cameras: Sequence[Camera]) -> F64:
    """Return intersection over union (C,) of the model's silhouette and the person's in each view; NaN where unseen."""
    overlap = np.full(len(cameras), np.nan)
    for silhouette in segmentation.of("person"):
        camera = cameras[silhouette.camera]
        covered = silhouettes.covered(surface, camera)
        overlap[silhouette.camera] = silhouettes.intersection_over_union(covered, silhouette.distance > 0)
    return overlap


def halfway(one: Pose, other: Pose) -> Pose:
    """Return the pose in the middle of two."""
    return moved(one, 0.5 * increment_between(one, other))


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names, each that was there before with its number: parzen, parzen_2."""
    counts = [names[: at + 1].count(name) for at, name in enumerate(names)]
    return tuple(name if count == 1 else f"{name}_{count}" for name, count in zip(names, counts, strict=True))
