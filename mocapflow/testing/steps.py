"""What the steps of the loop, and stages, have to hold to."""

from __future__ import annotations

from functools import partial
from typing import get_type_hints

import numpy as np
import pytest

from mocapflow.components import ClothFitter, Matcher, PoseSolver, Predictor, Prior, Recovery, Segmenter, Stage
from mocapflow.data import NO_CLOTH, Change, FrameResult, FrameState, Matches, Past, Pose, Surface, Turn
from mocapflow.model import ClothedModel, moved
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing import pictures, scenes
from mocapflow.testing.component import Conformance
from mocapflow.testing.jacobians import check_jacobian, differences
from mocapflow.testing.same import assert_pure, same

TURN = Turn(index=0, cap=8)


class PredictorConformance(Conformance):
    """A predictor."""

    role = "predictor"
    predictor: Predictor

    @pytest.mark.parametrize("known", [1, 2])
    def test_it_guesses_a_pose(self, known: int) -> None:
        """One or two earlier frames give a pose near the last one; nothing is changed."""
        scene = scenes.tiny_scene()
        poses = [moved(scenes.tiny_pose(scene, 2), 0.02 * k * np.ones(6 + len(scene.body.limits))) for k in range(2)]
        past = scenes.tiny_past(scene, *poses[-known:])
        guess = assert_pure(self.predictor.predict, pictures.tiny_frame(scene, poses[-1]), past, scene)
        assert isinstance(guess, Pose)
        np.testing.assert_allclose(guess.root[:3, :3] @ guess.root[:3, :3].T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(guess.root[3], [0, 0, 0, 1], atol=1e-12)
        assert np.abs(guess.angles - poses[-1].angles).max() < 0.5


class SegmenterConformance(Conformance):
    """A segmenter, on pictures of a bright person in a grey room whose empty view is known."""

    role = "segmenter"
    segmenter: Segmenter
    least_overlap = 0.7  # intersection over union with the true silhouette

    def test_it_finds_the_person(self) -> None:
        """One silhouette per usable view that fits the person; nothing is changed."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        believed = moved(pose, np.full(6 + len(pose.angles), 0.01))
        frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed)
        past = scenes.tiny_past(scene, believed)
        found = assert_pure(self.segmenter.segment, frame, state, past, scene, TURN)
        persons = found.of("person")
        assert [silhouette.camera for silhouette in persons] == list(range(len(scene.cameras)))
        for silhouette, truth in zip(persons, pictures.tiny_masks(scene, pose), strict=True):
            assert silhouette.distance.shape == truth.shape
            inside = silhouette.distance > 0
            overlap = (inside & truth).sum() / (inside | truth).sum()
            assert overlap >= self.least_overlap, f"camera {silhouette.camera}: overlap {overlap:.2f}"

    def test_a_lost_view_has_no_silhouette(self) -> None:
        """A view that is not usable is left out."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        frame = pictures.without_view(pictures.tiny_frame(scene, pose), 1)
        state = pictures.tiny_state(scene, pose)
        found = self.segmenter.segment(frame, state, scenes.tiny_past(scene, pose), scene, TURN)
        assert 1 not in {silhouette.camera for silhouette in found.silhouettes}


class MatcherConformance(Conformance):
    """A matcher, with true silhouettes and a surface one centimetre off."""

    role = "matcher"
    matcher: Matcher

    def matches(self, clothed: bool, lost: int | None = None) -> tuple[Matches, Scene, Surface]:
        """Return matches of a slightly wrong surface, one view lost or none."""
        scene = scenes.tiny_scene(clothed=clothed)
        pose = scenes.tiny_pose(scene, 4)
        believed = moved(pose, np.full(6 + len(pose.angles), 0.01))
        surface = scene.surface(believed, scenes.tiny_cloth(scene, believed))
        frame, segmentation = pictures.tiny_frame(scene, pose), pictures.tiny_segmentation(scene, pose)
        if lost is not None:
            frame = pictures.without_view(frame, lost)
            segmentation = pictures.without_silhouette(segmentation, lost)
        past = scenes.tiny_past(scene, believed)
        return assert_pure(self.matcher.match, frame, segmentation, surface, past, scene, TURN), scene, surface

    @pytest.mark.parametrize("clothed", [False, True])
    def test_matches_point_at_something(self, clothed: bool) -> None:
        """Cameras, pixels and vertices exist, weights are not negative, directions are unit or zero."""
        matches, scene, surface = self.matches(clothed)
        assert ((matches.camera >= 0) & (matches.camera < len(scene.cameras))).all()
        assert ((matches.vertex >= 0) & (matches.vertex < len(surface.vertices))).all()
        assert np.isfinite(matches.pixel).all()
        assert (np.isfinite(matches.weight) & (matches.weight >= 0)).all()
        length = np.linalg.norm(matches.direction, axis=1)
        assert (np.isclose(length, 1, atol=1e-6) | (length == 0)).all()

    @pytest.mark.parametrize("clothed", [False, True])
    def test_a_lost_view_has_no_matches(self, clothed: bool) -> None:
        """A view without a silhouette gives no matches."""
        matches, _, _ = self.matches(clothed, lost=1)
        assert 1 not in matches.camera


class PriorConformance(Conformance):
    """A prior.

    `bounds_energy` is for a prior that is no sum of squares: its rows are a quadratic bound of its energy with the
    same slope, so their Jacobian is not the derivative of their error.
    """

    role = "prior"
    prior: Prior
    bounds_energy = False
    tolerance = 1e-5

    @pytest.mark.parametrize("known", [0, 1, 2])
    @pytest.mark.parametrize("size", [0.1, 0.6])
    def test_its_jacobian_is_its_derivative(self, known: int, size: float) -> None:
        """Error, Jacobian and energy agree with each other, whatever is known of earlier frames."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 5, size)
        poses = [scenes.tiny_pose(scene, 6 + k, 0.1) for k in range(known)]
        past = scenes.tiny_past(scene, *poses)
        residual = assert_pure(self.prior.residual, pose, past, scene)
        unknowns = 6 + len(pose.angles)
        assert residual.jacobian.shape[1] >= unknowns
        assert np.isfinite(residual.error).all()
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
            state, turn = pictures.tiny_state(scene, pose, truth), Turn(index=index, cap=8)
            estimate = assert_pure(self.pose_solver.solve, lambda surface: matches, state, model, (), Past(), turn)
            pose = estimate.pose
        unknowns = 6 + len(truth.angles)
        assert estimate.covariance.shape == (unknowns, unknowns)
        np.testing.assert_allclose(estimate.covariance, estimate.covariance.T, rtol=1e-6, atol=1e-15)
        assert np.linalg.eigvalsh(estimate.covariance).min() >= -1e-12
        assert ((estimate.observed >= 0) & (estimate.observed <= 1)).all()
        reached, wanted = scene.surface(pose, NO_CLOTH).vertices, scene.surface(truth, NO_CLOTH).vertices
        assert np.linalg.norm(reached - wanted, axis=1).max() < 1e-3


class ClothFitterConformance(Conformance):
    """A cloth fitter, with a draper that leans a tube of cloth."""

    role = "cloth_fitter"
    cloth_fitter: ClothFitter

    def test_it_fits_within_the_bounds(self) -> None:
        """Cloth and parameters have their shapes, parameters stay in their ranges; nothing is changed."""
        scene = scenes.tiny_scene(clothed=True)
        pose = scenes.tiny_pose(scene, 9)
        state, model = pictures.tiny_state(scene, pose), scenes.tiny_model(scene)
        fit = partial(
            self.cloth_fitter.fit, pictures.tiny_frame(scene, pose), state.segmentation, state.estimate, model
        )
        cloth = assert_pure(fit, scenes.tiny_past(scene, pose), TURN)
        assert scene.garment is not None
        assert cloth.vertices.shape == scene.garment.vertices.shape
        assert np.isfinite(cloth.vertices).all()
        low, high = scene.garment.parameter_bounds.T
        assert ((cloth.parameters >= low) & (cloth.parameters <= high)).all()
        np.testing.assert_allclose(model.drape(pose, cloth.parameters, Past()).vertices, cloth.vertices, atol=1e-9)

    def test_a_person_without_a_garment(self) -> None:
        """Without a garment the cloth is empty."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 9)
        state, model = pictures.tiny_state(scene, pose), scenes.tiny_model(scene)
        frame = pictures.tiny_frame(scene, pose)
        cloth = self.cloth_fitter.fit(frame, state.segmentation, state.estimate, model, Past(), TURN)
        assert cloth.vertices.shape == (0, 3)


class RecoveryConformance(Conformance):
    """A recovery, in a room whose empty view is known."""

    role = "recovery"
    recovery: Recovery

    def test_a_right_fit_is_left_alone(self) -> None:
        """Where model and images agree nothing is tried, and the result stays as it is."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        state = pictures.tiny_state(scene, pose)
        result = _settled(state)
        frame, model, past = pictures.tiny_frame(scene, pose), scenes.tiny_model(scene), scenes.tiny_past(scene, pose)
        recovered = assert_pure(self.recovery.recover, frame, state, result, past, model, _not_to_be_called)
        assert same(recovered, result)

    def test_a_lost_limb_does_not_stay_unnoticed(self) -> None:
        """With a leg where there is none, the loop is begun elsewhere, nearer; what happened is noted."""
        scene = scenes.tiny_scene()
        truth = scenes.tiny_pose(scene, 3, 0.1)
        lost = Pose(root=truth.root, angles=truth.angles + np.where(np.arange(len(truth.angles)) == 1, 0.9, 0.0))
        state, model = pictures.tiny_state(scene, lost, truth), scenes.tiny_model(scene)
        frame, past = pictures.tiny_frame(scene, truth), scenes.tiny_past(scene, lost)

        def settle(pose: Pose, parameters: F64) -> FrameResult:
            return _settled(pictures.tiny_state(scene, pose, truth))

        recovered = assert_pure(self.recovery.recover, frame, state, _settled(state), past, model, settle)
        assert recovered.notes
        wanted = scene.surface(truth, NO_CLOTH).vertices
        before, after = (
            np.linalg.norm(scene.surface(pose, NO_CLOTH).vertices - wanted, axis=1).max()
            for pose in (lost, recovered.state.estimate.pose)
        )
        assert after < 0.5 * before


def _settled(state: FrameState) -> FrameResult:
    """Return a state as what the loop hands over."""
    return FrameResult(
        state=state,
        iterations=1,
        steady=True,
        oscillating=False,
        change=Change(body=0.0, cloth=0.0, angles=0.0),
        overlap=np.ones(len(state.segmentation.silhouettes)),
        energy=np.zeros((1, 0)),
        energy_terms=(),
    )


def _not_to_be_called(pose: Pose, parameters: F64) -> FrameResult:
    raise AssertionError("a fit that is right needs no other")


class StageConformance(Conformance):
    """A whole-sequence stage."""

    role = "stage"
    stage: Stage

    def test_its_inputs_and_output_are_typed(self) -> None:
        """Every parameter of `run` and its result have a type that can be read: they are the wiring."""
        hints = get_type_hints(type(self.stage).run)
        parameters = set(type(self.stage).run.__code__.co_varnames[1 : type(self.stage).run.__code__.co_argcount])
        assert parameters <= hints.keys()
        assert isinstance(hints["return"], type)
