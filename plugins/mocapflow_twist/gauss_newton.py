"""The cloth fitter that alternates with the pose: Gauss–Newton on the parameters of the garment at a fixed pose."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import PositiveFloat

from mocapflow.assets import GarmentMesh
from mocapflow.components import ClothFitter
from mocapflow.data import (
    Cloth,
    Contour,
    Estimate,
    Frame,
    Matches,
    Past,
    PoseBatch,
    Segmentation,
    Silhouette,
    Surface,
    Turn,
)
from mocapflow.geometry.differences import drape_differences
from mocapflow.geometry.misfit import bilinear, dressed, misfit, outlines
from mocapflow.geometry.sewing import NO_FORCES
from mocapflow.model import ClothedModel
from mocapflow.pooling import pool
from mocapflow.records import F64
from mocapflow_twist import steps
from mocapflow_twist.constraint import image_rows
from mocapflow_twist.normal_equations import Equations, dense_equations

STEPS = 3  # at most
FIRST_DAMPING = 1e-3  # share of the mean diagonal
TRIALS = 4  # times that the damping is raised before a step is given up


class GaussNewton(ClothFitter):
    """Moves the outline of the cloth onto the silhouettes by its forces.

    Each force is held near zero. The thickness, which moves the outline by less than a pixel, and the take-up are left
    as they are. `cloth_unknowns` of twist_gauss_newton solves for the same parameters together with the pose, and from
    matches; this fitter alternates with the pose, and reads the distance fields.
    """

    name: ClassVar[str] = "gauss_newton"
    sigma_px: PositiveFloat = 3.0  # standard deviation of the outline of cloth
    correlation_px: PositiveFloat = 15.0  # length over which the outline's errors agree
    cloth_sd: PositiveFloat = 0.15  # standard deviation of each parameter about a calm garment, share of its range
    spacing_px: PositiveFloat = 4.0  # between the points of the outline

    def fit(
        self, frame: Frame, segmentation: Segmentation, estimate: Estimate, model: ClothedModel, past: Past, turn: Turn
    ) -> Cloth:
        """Return the cloth at the estimated pose with the parameters that fit best."""
        cloth, garment = model.drape(estimate.pose, estimate.parameters, past), model.scene.garment
        if garment is None or not segmentation.silhouettes:
            return cloth
        task = Task(self, segmentation, estimate, model, garment, past, model.surface(estimate.pose, cloth))
        energy, damping = task.energy(cloth), FIRST_DAMPING
        for _ in range(STEPS):
            equations, before = task.equations(cloth), cloth
            for _ in range(TRIALS):
                trial = task.moved(before, equations, damping)
                reached = task.energy(trial)
                if reached < energy:
                    cloth, energy, damping = trial, reached, steps.LOWERED * damping
                    break
                damping *= steps.RAISED
            if cloth is before:
                break
        return cloth


class Task(NamedTuple):
    """What stays the same while one garment is fitted."""

    fitter: GaussNewton
    segmentation: Segmentation
    estimate: Estimate
    model: ClothedModel
    garment: GarmentMesh
    past: Past
    surface: Surface

    @property
    def precision(self) -> F64:
        """One over the variance of each parameter: (Q,)."""
        spread: F64 = self.fitter.cloth_sd * np.ptp(self.garment.parameter_bounds, axis=1)
        return np.maximum(spread, 1e-12) ** -2.0

    @property
    def weight(self) -> float:
        """One over the variance (px^-2) of an outline point, as one of many whose errors agree."""
        return self.fitter.spacing_px / self.fitter.correlation_px / self.fitter.sigma_px**2

    def energy(self, cloth: Cloth) -> float:
        """Return half the weighted squared errors of the whole outline and of the parameters."""
        now = dressed(self.surface, cloth.vertices)
        spacing = self.fitter.spacing_px
        off = misfit(now, self.segmentation, self.model.scene.cameras, spacing).sum() / spacing
        return 0.5 * (self.weight * float(off) + float(self.precision @ self._from_neutral(cloth) ** 2))

    def equations(self, cloth: Cloth) -> Equations:
        """Return the quadratic model of the energy about the parameters of a cloth."""
        cameras, first = self.model.scene.cameras, len(self.model.scene.body.vertices)
        matches = self.matches(dressed(self.surface, cloth.vertices))
        rows = image_rows(matches, cameras)
        worn = rows.part(rows.vertex >= first, rows.weight, first)
        hessian, gradient, energy = dense_equations(worn, cloth.vertices, self._velocity(cloth))
        off = self._from_neutral(cloth)
        pull = self.precision * off
        return Equations(hessian + np.diag(self.precision), gradient + pull, energy + 0.5 * float(pull @ off))

    def moved(self, cloth: Cloth, equations: Equations, damping: float) -> Cloth:
        """Return the cloth after one damped step, its parameters within their bounds."""
        low, high = self.garment.parameter_bounds.T
        parameters, downhill = cloth.parameters, -equations.gradient
        free = ~steps.at_bound(parameters, downhill, low, high)
        free[self.garment.columns(*NO_FORCES)] = False
        if not free.any():  # the garment knows no forces, or each stands at a bound
            return cloth
        part = Equations(equations.hessian[np.ix_(free, free)], equations.gradient[free], equations.energy)
        increment = np.zeros(len(parameters))
        increment[free] = steps.step(part, steps.CLOTH_LEVER / (high - low)[free], damping)
        return self.model.drape(self.estimate.pose, np.clip(parameters + increment, low, high), self.past)

    def _from_neutral(self, cloth: Cloth) -> F64:
        return cloth.parameters - self.model.scene.neutral_parameters

    def _velocity(self, cloth: Cloth) -> F64:
        """Return the velocities (W, 3, Q) of the cloth for unit changes of its parameters."""
        body, pose = self.model.scene.body, self.estimate.pose

        def drape(poses: PoseBatch, parameters: F64) -> F64:
            return self.model.drapes(pose, parameters, self.past)

        still = np.zeros(len(body.parents), bool)  # the pose is fixed: no joint is tried
        bounds = self.garment.parameter_bounds
        velocity = drape_differences(drape, body, still, bounds, pose, cloth.parameters)
        return velocity[..., 6 + len(pose.angles) :]

    def matches(self, surface: Surface) -> Matches:
        """Return the points of the outline, each with where the distance field says the silhouette is."""
        views = outlines(surface, self.segmentation, self.model.scene.cameras, self.fitter.spacing_px)
        return pool([self._matches_in(silhouette, contour) for silhouette, contour in views])

    def _matches_in(self, silhouette: Silhouette, contour: Contour) -> Matches:
        slope = np.stack([bilinear(axis, contour.pixel) for axis in np.gradient(silhouette.distance)[::-1]], axis=1)
        steep = np.linalg.norm(slope, axis=1)
        seen = steep > 0.5  # beyond the band the field is level
        outward = -slope[seen] / steep[seen, None]
        inside = bilinear(silhouette.distance, contour.pixel[seen])[:, None]
        return Matches(
            camera=np.full(len(outward), silhouette.camera, np.int16),
            pixel=contour.anchor[seen] + inside * outward,
            direction=outward,
            vertex=contour.vertex[seen],
            weight=np.full(len(outward), self.weight),
        )
