"""What the steps that fit have to hold to: priors, pose solvers, cloth fitters."""

from __future__ import annotations

import numpy as np
import pytest

from mocapflow.components import ClothFitter, PoseSolver, Prior
from mocapflow.data import NO_CLOTH, Matches, Past, Pose, Turn
from mocapflow.guards.outputs import cloth_of, estimate_of, residual_of
from mocapflow.model import ClothedModel, moved
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing import pictures, scenes
from mocapflow.testing.component import TURN, Conformance
from mocapflow.testing.jacobians import check_jacobian, differences
from mocapflow.testing.same import assert_pure


class PriorConformance(Conformance):
    """A prior.

    `bounds_energy` is for a prior that is no sum of squares: its rows are a quadratic bound of its energy with the
    same slope, so their Jacobian is not the derivative of their error.
    """

    role = "prior"
    prior: Prior
    bounds_energy = False
    tolerance = 1e-5

    @pytest.mark.parametrize("known", [0, 1, 2], ids="{} frames before".format)
    @pytest.mark.parametrize("size", [0.1, 0.6], ids="{} rad off".format)
    def test_its_jacobian_is_its_derivative(self, known: int, size: float) -> None:
        """Error, Jacobian and energy agree with each other, whatever is known of earlier frames."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 5, size)
        poses = [scenes.tiny_pose(scene, 6 + k, 0.1) for k in range(known)]
        past = scenes.tiny_past(scene, *poses)
        residual = assert_pure(residual_of, self.prior, pose, past, scene)
        unknowns = 6 + len(pose.angles)
        assert np.isfinite(residual.energy)

        def at(increment: F64) -> tuple[F64, F64]:
            there = self.prior.residual(moved(pose, increment), past, scene)
            return there.error, there.jacobian[:, :unknowns]

        def energy(increment: F64) -> F64:
            return np.array([self.prior.residual(moved(pose, increment), past, scene).energy])

        if not self.bounds_energy:
            check_jacobian(at, np.zeros(unknowns), tolerance=self.tolerance)
        slope = differences(energy, np.zeros(unknowns))[0]
        expected = residual.jacobian[:, :unknowns].T @ residual.error
        np.testing.assert_allclose(slope, expected, atol=self.tolerance * max(1.0, np.abs(expected).max()))

    def test_where_rest_has_its_origin_does_not_matter(self) -> None:
        """A body whose rest lies elsewhere, in the same pose, costs the same."""
        scene, shift = scenes.tiny_scene(), np.array([0.3, -0.5, 2.0])
        past = [scenes.tiny_pose(scene, 6 + k, 0.1) for k in range(2)]
        poses = [*past, scenes.tiny_pose(scene, 5, 0.3)]
        elsewhere = scenes.rebased(scene, poses[0], shift)[0]
        there = [scenes.rebased(scene, pose, shift)[1] for pose in poses]
        here = self.prior.residual(poses[-1], scenes.tiny_past(scene, *past), scene)
        other = self.prior.residual(there[-1], scenes.tiny_past(elsewhere, *there[:-1]), elsewhere)
        np.testing.assert_allclose(other.energy, here.energy, rtol=1e-6, atol=1e-9)


class PoseSolverConformance(Conformance):
    """A pose solver, given exact pairs of vertices and pixels."""

    role = "pose_solver"
    pose_solver: PoseSolver

    def test_it_solves(self) -> None:
        """A few calls bring every vertex within a millimetre; covariance and shares are such; nothing is changed."""
        scene = scenes.tiny_scene()
        truth = scenes.tiny_pose(scene, 8)
        pose = moved(truth, np.full(6 + len(truth.angles), 0.03))
        matches, model = scenes.exact_matches(scene, truth), ClothedModel(scene=scene)
        for index in range(4):
            state, turn = pictures.tiny_state(scene, pose, truth), Turn(index=index)
            given = (lambda surface: matches, state, model, (), Past(), turn)
            estimate = assert_pure(estimate_of, self.pose_solver, *given)
            pose = estimate.pose
        unknowns = 6 + len(truth.angles)
        assert estimate.covariance.shape == (unknowns, unknowns)
        np.testing.assert_allclose(estimate.covariance, estimate.covariance.T, rtol=1e-6, atol=1e-15)
        assert ((estimate.observed >= 0) & (estimate.observed <= 1)).all()
        reached, wanted = scene.surface(pose, NO_CLOTH).vertices, scene.surface(truth, NO_CLOTH).vertices
        assert np.linalg.norm(reached - wanted, axis=1).max() < 1e-3

    def test_where_rest_has_its_origin_does_not_matter(self) -> None:
        """From a pose far off, a body whose rest lies elsewhere comes to the same place in one call."""
        scene, shift = scenes.tiny_scene(), np.array([0.3, -0.5, 2.0])
        truth = scenes.tiny_pose(scene, 8)
        start, matches = moved(truth, np.full(6 + len(truth.angles), 0.2)), scenes.exact_matches(scene, truth)
        reached = [
            kept.surface(self._solved(kept, pose, matches), NO_CLOTH).vertices
            for kept, pose in ((scene, start), scenes.rebased(scene, start, shift))
        ]
        np.testing.assert_allclose(reached[1], reached[0], atol=1e-6)

    def _solved(self, scene: Scene, pose: Pose, matches: Matches) -> Pose:
        state, model = pictures.tiny_state(scene, pose), ClothedModel(scene=scene)
        return self.pose_solver.solve(lambda surface: matches, state, model, (), Past(), TURN).pose


class ClothFitterConformance(Conformance):
    """A cloth fitter, with a draper that leans a tube of cloth."""

    role = "cloth_fitter"
    cloth_fitter: ClothFitter

    def test_it_fits_within_the_bounds(self) -> None:
        """Cloth and parameters have their shapes, parameters stay in their ranges; nothing is changed."""
        scene = scenes.tiny_scene(clothed=True)
        pose = scenes.tiny_pose(scene, 9)
        state, model = pictures.tiny_state(scene, pose), scenes.tiny_model(scene)
        frame, past = pictures.tiny_frame(scene, pose), scenes.tiny_past(scene, pose)
        given = (frame, state.segmentation, state.estimate, model, past, TURN)
        cloth = assert_pure(cloth_of, self.cloth_fitter, *given)
        assert scene.garment is not None
        low, high = scene.garment.parameter_bounds.T
        assert ((cloth.parameters >= low) & (cloth.parameters <= high)).all()
        np.testing.assert_allclose(model.drape(pose, cloth.parameters, Past()).vertices, cloth.vertices, atol=1e-9)

    def test_a_person_without_a_garment(self) -> None:
        """Without a garment the cloth is empty."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 9)
        state, model = pictures.tiny_state(scene, pose), scenes.tiny_model(scene)
        frame = pictures.tiny_frame(scene, pose)
        for past in (Past(), scenes.tiny_past(scene, pose)):
            cloth = self.cloth_fitter.fit(frame, state.segmentation, state.estimate, model, past, TURN)
            assert cloth.vertices.shape == (0, 3)
