"""What a component of each role has to hold to: subclass, and name the component.

Every check works on the tiny scene of `mocapflow.testing.scenes`.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from pydantic import ValidationError

from mocapflow.components import (
    BodyModel,
    ClothFitter,
    Component,
    Draper,
    Garment,
    Matcher,
    PoseSolver,
    Predictor,
    Prior,
    Segmenter,
    Stage,
)
from mocapflow.data import NO_CLOTH, Body, GarmentMesh, Matches, Past, Pose, PoseBatch, Surface, Turn
from mocapflow.geometry import kinematics
from mocapflow.model import ClothedModel, moved
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow.testing import scenes
from mocapflow.testing.jacobians import check_jacobian, differences
from mocapflow.testing.same import assert_pure

TURN = Turn(index=0, cap=8)


class Conformance:
    """What holds for every component; a subclass has it under the name of its role."""

    role: str

    @property
    def component(self) -> Component:
        """The component under test."""
        component: Component = getattr(self, self.role)
        return component

    def test_it_plays_its_role(self) -> None:
        """It has the name of its role, a name and a description."""
        assert self.component.role == self.role
        assert self.component.name
        assert type(self.component).__doc__, "say in a docstring what it does"

    def test_settings_survive_a_round_trip(self) -> None:
        """Built again from its settings it has the same settings."""
        cls = type(self.component)
        again = cls(**{name: getattr(self.component, name) for name in cls.model_fields})
        assert again.model_dump(serialize_as_any=True) == self.component.model_dump(serialize_as_any=True)

    def test_settings_give_a_stable_text(self) -> None:
        """Its settings as JSON are always the same: they are part of the cache key."""
        cls = type(self.component)
        again = cls(**{name: getattr(self.component, name) for name in reversed(cls.model_fields)})
        text = self.component.model_dump_json(serialize_as_any=True)
        assert again.model_dump_json(serialize_as_any=True) == text
        assert isinstance(json.loads(text), dict)

    def test_settings_are_frozen(self) -> None:
        """No setting can be changed, none added."""
        for name in type(self.component).model_fields:
            with pytest.raises(ValidationError, match="frozen"):
                setattr(self.component, name, getattr(self.component, name))
        with pytest.raises(ValidationError, match="no_such_setting"):
            type(self.component)(**{**dict(self.component), "no_such_setting": 1})


class GarmentConformance(Conformance):
    """A garment; `body` is what it is sewn on."""

    role = "garment"
    garment: Garment

    def make_body(self) -> Body:
        """Return the body it is sewn on."""
        return scenes.tiny_body()

    def sewn(self) -> GarmentMesh:
        """Return the garment sewn twice on the body, once checked for purity."""
        return assert_pure(self.garment.sew, self.make_body())  # type: ignore[no-any-return]

    def test_indices_are_in_range(self) -> None:
        """Faces, strands, rings, pins and joints point at something."""
        mesh, body = self.sewn(), self.make_body()
        count = len(mesh.vertices)
        assert np.isfinite(mesh.vertices).all()
        for name in ("faces", "rings", "pinned"):
            indices = getattr(mesh, name)
            assert ((indices >= 0) & (indices < count)).all(), f"{name} points beyond the {count} vertices"
        assert ((mesh.strands >= -1) & (mesh.strands < count)).all()
        assert ((mesh.carried_by >= 0) & (mesh.carried_by < len(body.parents))).all()
        assert ((mesh.pinned_to >= 0) & (mesh.pinned_to < len(body.vertices))).all()

    def test_strands_are_padded_at_the_end_only(self) -> None:
        """After a -1 no vertex follows, and no vertex comes twice in a strand."""
        for strand in self.sewn().strands:
            kept = strand[strand >= 0]
            assert (strand[: len(kept)] >= 0).all()
            assert len(np.unique(kept)) == len(kept)

    def test_faces_are_not_degenerate(self) -> None:
        """Every face has an area, every vertex belongs to a face, no edge has more than two faces."""
        mesh = self.sewn()
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
        assert (np.linalg.norm(np.cross(b - a, c - a), axis=1) > 2e-10).all(), "a face has no area"
        assert len(np.unique(mesh.faces)) == len(mesh.vertices), "a vertex belongs to no face"
        pairs = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
        assert np.unique(pairs, axis=0, return_counts=True)[1].max() <= 2, "an edge has more than two faces"

    def test_pins_lie_on_the_body(self) -> None:
        """A pinned vertex is within 10 cm of the skin that holds it, and pinned once."""
        mesh, body = self.sewn(), self.make_body()
        away = np.linalg.norm(mesh.vertices[mesh.pinned] - body.vertices[mesh.pinned_to], axis=1)
        assert len(mesh.pinned) > 0
        assert len(np.unique(mesh.pinned)) == len(mesh.pinned)
        assert away.max() < 0.10, f"a pin is {away.max():.3f} m from the skin"

    def test_rings_and_parameters(self) -> None:
        """Lengths of links are positive; each parameter has a name and a range that holds its rest value, zero."""
        mesh = self.sewn()
        assert (mesh.ring_length > 0).all()
        assert len(set(mesh.parameter_names)) == len(mesh.parameter_names) == len(mesh.parameter_bounds)
        low, high = mesh.parameter_bounds.T
        assert (low < high).all()


class DraperConformance(Conformance):
    """A draper, on a tube of cloth hung on the tiny body."""

    role = "draper"
    draper: Draper

    def make_scene(self) -> Scene:
        """Return a clothed scene."""
        return scenes.tiny_scene(clothed=True)

    def test_it_drapes_a_batch(self) -> None:
        """B poses give (B, W, 3) finite vertices, the same as one by one, and nothing is changed."""
        scene = self.make_scene()
        poses, parameters = _batch(scene)
        draped = assert_pure(self.draper.drape, poses, parameters, Past(), scene)
        assert scene.garment is not None
        assert draped.shape == (3, len(scene.garment.vertices), 3)
        assert draped.dtype == np.float64
        assert np.isfinite(draped).all()
        for row in range(3):
            one = PoseBatch(root=poses.root[row : row + 1].copy(), angles=poses.angles[row : row + 1].copy())
            alone = self.draper.drape(one, parameters[row : row + 1], Past(), scene)
            np.testing.assert_allclose(alone[0], draped[row], atol=1e-9)

    def test_cloth_goes_where_the_person_goes(self) -> None:
        """Shifting the person shifts the cloth."""
        scene = self.make_scene()
        poses, parameters = _batch(scene)
        shift = np.array([0.31, -0.17, 0.05])
        root = poses.root.copy()
        root[:, :3, 3] += shift
        here = self.draper.drape(poses, parameters, Past(), scene)
        there = self.draper.drape(PoseBatch(root=root, angles=poses.angles), parameters, Past(), scene)
        np.testing.assert_allclose(there, here + shift, atol=1e-6)

    def test_velocities(self) -> None:
        """Velocities are (M, 3, 6 + D + Q); a shift of the root moves every vertex along."""
        scene = self.make_scene()
        pose = scenes.tiny_pose(scene, 1)
        assert scene.garment is not None
        vertices = np.arange(0, len(scene.garment.vertices), 7, dtype=np.int32)
        parameters = scene.garment.parameter_bounds.mean(axis=1)
        velocity = assert_pure(self.draper.velocity, pose, parameters, vertices, Past(), scene)
        assert velocity.shape == (len(vertices), 3, 6 + len(pose.angles) + len(parameters))
        assert np.isfinite(velocity).all()
        np.testing.assert_allclose(velocity[:, :, 3:6], np.broadcast_to(np.eye(3), (len(vertices), 3, 3)), atol=1e-4)


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
        guess = assert_pure(self.predictor.predict, scenes.tiny_frame(scene, poses[-1]), past, scene)
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
        frame, state = scenes.tiny_frame(scene, pose), scenes.tiny_state(scene, believed)
        past = scenes.tiny_past(scene, believed)
        found = assert_pure(self.segmenter.segment, frame, state, past, scene, TURN)
        persons = [silhouette for silhouette in found.silhouettes if silhouette.layer == "person"]
        assert [silhouette.camera for silhouette in persons] == list(range(len(scene.cameras)))
        for silhouette, truth in zip(persons, scenes.tiny_masks(scene, pose), strict=True):
            assert silhouette.distance.shape == truth.shape
            inside = silhouette.distance > 0
            overlap = (inside & truth).sum() / (inside | truth).sum()
            assert overlap >= self.least_overlap, f"camera {silhouette.camera}: overlap {overlap:.2f}"

    def test_a_lost_view_has_no_silhouette(self) -> None:
        """A view that is not usable is left out."""
        scene = scenes.tiny_scene()
        pose = scenes.tiny_pose(scene, 3, 0.1)
        frame = scenes.without_view(scenes.tiny_frame(scene, pose), 1)
        state = scenes.tiny_state(scene, pose)
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
        frame, segmentation = scenes.tiny_frame(scene, pose), scenes.tiny_segmentation(scene, pose)
        if lost is not None:
            frame = scenes.without_view(frame, lost)
            segmentation = scenes.without_silhouette(segmentation, lost)
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
    """A prior."""

    role = "prior"
    prior: Prior
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

        check_jacobian(at, np.zeros(unknowns), tolerance=self.tolerance)
        slope = differences(energy, np.zeros(unknowns))[0]
        expected = residual.jacobian[:, :unknowns].T @ residual.error
        np.testing.assert_allclose(slope, expected, atol=self.tolerance * max(1.0, np.abs(expected).max()))


class PoseSolverConformance(Conformance):
    """A pose solver, given exact pairs of vertices and pixels."""

    role = "pose_solver"
    pose_solver: PoseSolver

    def test_it_solves(self) -> None:
        """A few calls bring every vertex to within a millimetre; the covariance is one; nothing is changed."""
        scene = scenes.tiny_scene()
        truth = scenes.tiny_pose(scene, 8)
        pose = moved(truth, np.full(6 + len(truth.angles), 0.03))
        matches, model = scenes.exact_matches(scene, truth), ClothedModel(scene=scene)
        for index in range(4):
            state, turn = scenes.tiny_state(scene, pose, truth), Turn(index=index, cap=8)
            estimate = assert_pure(self.pose_solver.solve, lambda surface: matches, state, model, (), Past(), turn)
            pose = estimate.pose
        unknowns = 6 + len(truth.angles)
        assert estimate.covariance.shape == (unknowns, unknowns)
        np.testing.assert_allclose(estimate.covariance, estimate.covariance.T, rtol=1e-6, atol=1e-15)
        assert np.linalg.eigvalsh(estimate.covariance).min() >= -1e-12
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
        state, model = scenes.tiny_state(scene, pose), scenes.tiny_model(scene)
        fit = partial(self.cloth_fitter.fit, scenes.tiny_frame(scene, pose), state.segmentation, state.estimate, model)
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
        state, model = scenes.tiny_state(scene, pose), scenes.tiny_model(scene)
        frame = scenes.tiny_frame(scene, pose)
        cloth = self.cloth_fitter.fit(frame, state.segmentation, state.estimate, model, Past(), TURN)
        assert cloth.vertices.shape == (0, 3)


class BodyConformance(Conformance):
    """A body; `recording` is the folder it is loaded for."""

    role = "body"
    body: BodyModel
    recording: Path

    def test_the_chain_is_in_order(self) -> None:
        """Parents come first, screws stand by joint and are unit twists, rest lies within the limits."""
        body = self.body.load(self.recording)
        assert body.parents[0] == -1
        assert (body.parents < np.arange(len(body.parents))).all()
        assert (np.diff(body.screw_joint) >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(body.twists[:, :3], axis=1), 1, atol=1e-9)
        pitch = (body.twists[:, :3] * body.twists[:, 3:]).sum(axis=1)
        np.testing.assert_allclose(pitch, 0, atol=1e-9)
        assert (body.limits[:, 0] < body.limits[:, 1]).all()
        assert len(body.screw_names) == len(set(body.screw_names)) == len(body.twists)

    def test_the_skin(self) -> None:
        """Weights sum to one, indices exist, and at rest the posed skin is the mesh."""
        body = self.body.load(self.recording)
        assert ((body.faces >= 0) & (body.faces < len(body.vertices))).all()
        assert ((body.skin_joint >= 0) & (body.skin_joint < len(body.parents))).all()
        np.testing.assert_allclose(body.skin_weight.sum(axis=1), 1, atol=1e-9)
        assert (body.skin_weight >= 0).all()
        rest = Pose(root=np.eye(4), angles=np.zeros(len(body.twists)))
        joints, _ = kinematics.chain(body, rest)
        posed = Scene(cameras=(), body=body).surface(rest, NO_CLOTH).vertices
        np.testing.assert_allclose(posed, body.vertices, atol=1e-9)
        np.testing.assert_allclose(joints, np.broadcast_to(np.eye(4), joints.shape), atol=1e-12)

    def test_it_names_the_files_it_reads(self) -> None:
        """The files exist: their content is part of the cache key."""
        for path in self.body.inputs(self.recording):
            assert path.exists()


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


def _batch(scene: Scene) -> tuple[PoseBatch, F64]:
    poses = [scenes.tiny_pose(scene, seed) for seed in range(3)]
    batch = PoseBatch(root=np.stack([p.root for p in poses]), angles=np.stack([p.angles for p in poses]))
    assert scene.garment is not None
    low, high = scene.garment.parameter_bounds.T
    share = np.random.default_rng(0).uniform(0.2, 0.8, (3, len(low)))
    return batch, low + share * (high - low)
