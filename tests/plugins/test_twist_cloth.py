"""Points on cloth pull on pose and cloth parameters through the draper's velocities."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from mocapflow_twist.constraint import image_rows
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.normal_equations import Equations, dense_equations
from mocapflow_twist.steps import at_bound
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton
from test_twist_solver import EXACT, TURN, energies_of
from twist_fixtures import exact_matches, make_pose, make_scene, make_state

from mocapflow.assets import GarmentMesh
from mocapflow.data import Estimate, FrameState, Matches, Past, Pose, PoseBatch, Surface
from mocapflow.dressing.roles import Draper
from mocapflow.geometry import cameras, twists
from mocapflow.model import ClothedModel, moved
from mocapflow.pooling import pool
from mocapflow.records import F64, I32
from mocapflow.scene import Scene

COUNT = 40
SHAPE = np.random.default_rng(7).normal(size=(COUNT, 3)) * 0.2
BY_ANGLE = np.random.default_rng(8).normal(size=(COUNT, 3, 12)) * 0.05
BY_PARAMETER = np.random.default_rng(9).normal(size=(COUNT, 3, 2)) * 0.1


class LinearDraper(Draper):
    """Cloth that is linear in angles and parameters, carried along with the root."""

    name: ClassVar[str] = "linear"

    def drape(self, poses: PoseBatch, parameters: F64, past: Past, scene: Scene) -> F64:
        local = SHAPE + np.einsum("vad,bd->bva", BY_ANGLE, poses.angles)
        local = local + np.einsum("vaq,bq->bva", BY_PARAMETER, parameters)
        return np.einsum("bxa,bva->bvx", poses.root[:, :3, :3], local) + poses.root[:, None, :3, 3]

    def velocity(self, pose: Pose, parameters: F64, vertices: I32, past: Past, scene: Scene) -> F64:
        poses = PoseBatch(root=pose.root[None].copy(), angles=pose.angles[None].copy())
        points = self.drape(poses, parameters[None], past, scene)[0][vertices]
        inner = np.concatenate([BY_ANGLE, BY_PARAMETER], axis=2)[vertices]
        shift = np.tile(np.eye(3), (len(vertices), 1, 1))
        return np.concatenate([-twists.hat(points), shift, pose.root[:3, :3] @ inner], axis=2)


def garment() -> GarmentMesh:
    index = np.arange(COUNT, dtype=np.int32)
    return GarmentMesh(
        name="sheet", vertices=SHAPE.copy(), faces=index[None, :3].copy(), strands=index[None].copy(),
        rings=np.empty((0, 2), np.int32), ring_length=np.empty(0), carried_by=np.zeros(COUNT, np.int32),
        pinned=np.empty(0, np.int32), pinned_to=np.empty(0, np.int32), parameter_names=("lean", "swell"),
        parameter_bounds=np.array([[-1.0, 1.0], [0.0, 0.5]]),
    )  # fmt: skip


MODEL = ClothedModel(scene=replace(make_scene(), garment=garment()), draper=LinearDraper())


def make_matches(pose: Pose, parameters: F64, vertices: np.ndarray) -> Matches:
    """Exact matches of a few body vertices and of cloth vertices."""
    cloth = MODEL.drape(pose, parameters, Past())
    count = len(vertices) * len(MODEL.scene.cameras)
    on_cloth = Matches(
        camera=np.repeat(np.arange(4, dtype=np.int16), len(vertices)),
        pixel=np.concatenate([cameras.project(cloth.vertices[vertices], c) for c in MODEL.scene.cameras]),
        direction=np.zeros((count, 2)),
        vertex=np.tile(vertices + 300, 4).astype(np.int32),
        weight=np.ones(count),
    )
    return pool([on_cloth, exact_matches(MODEL.scene, pose, np.arange(0, 300, 30), False)])


def clothed_state(pose: Pose, parameters: F64) -> FrameState:
    return replace(make_state(pose), cloth=MODEL.drape(pose, parameters, Past()))


def solve(matches: Matches, state: FrameState, **settings: Any) -> Estimate:
    solver = TwistGaussNewton(**{**EXACT, "cloth_sd": 1e6, **settings})
    return solver.solve(lambda _: matches, state, MODEL, [], Past(), TURN)


def test_cloth_columns_are_the_numeric_derivatives() -> None:
    pose, parameters, every = make_pose(0), np.array([0.2, 0.3]), np.arange(COUNT)
    rows = image_rows(make_matches(make_pose(1), parameters, every), MODEL.scene.cameras)
    rows = rows.part(rows.vertex >= 300, rows.weight, 300)

    def energy_and_slope(increment: F64) -> tuple[float, F64]:
        there, q = moved(pose, increment[:18]), parameters + increment[18:]
        cloth = MODEL.drape(there, q, Past())
        velocity = MODEL.velocity(there, cloth, np.arange(len(cloth.vertices), dtype=np.int32), Past())
        equations = dense_equations(rows, cloth.vertices, velocity)
        return equations.energy, equations.gradient

    step = 1e-5
    numeric = [(energy_and_slope(step * c)[0] - energy_and_slope(-step * c)[0]) / (2 * step) for c in np.eye(20)]
    slope = energy_and_slope(np.zeros(20))[1]
    assert np.abs(slope - numeric).max() < 1e-7 * np.abs(slope).max()


def test_pose_and_cloth_parameters_are_found_together() -> None:
    """The motion of the cloth is measured at the start only; draped anew it is exact all the same."""
    truth, wanted = make_pose(0), np.array([0.2, 0.3])
    start = moved(truth, np.random.default_rng(0).normal(size=18) * 0.01)
    matches = make_matches(truth, wanted, np.arange(COUNT))
    estimate = solve(
        matches, clothed_state(start, np.array([0.1, 0.2])), cloth_unknowns=True, iterations=30,
    )  # fmt: skip
    assert np.abs(estimate.pose.angles - truth.angles).max() < 1e-7
    assert estimate.parameters == pytest.approx(wanted, abs=1e-7)
    assert estimate.covariance.shape == (20, 20)


def test_by_default_the_cloth_parameters_are_given() -> None:
    truth, given = make_pose(0), np.array([0.2, 0.3])
    start = moved(truth, np.random.default_rng(0).normal(size=18) * 0.05)
    estimate = solve(make_matches(truth, given, np.arange(COUNT)), clothed_state(start, given), iterations=20)
    assert np.abs(estimate.pose.angles - truth.angles).max() < 1e-8
    assert np.array_equal(estimate.parameters, given) and estimate.covariance.shape == (18, 18)


def test_cloth_parameters_stay_within_their_bounds() -> None:
    truth, beyond = make_pose(0), np.array([0.2, 0.8])
    matches = make_matches(truth, beyond, np.arange(COUNT))
    state = clothed_state(truth, np.array([0.2, 0.4]))
    before = TwistGaussNewton(iterations=1, cap_deg=1e-9, cap_mm=1e-9, cloth_unknowns=True)
    unmoved = before.solve(lambda _: matches, state, MODEL, [], Past(), TURN)
    estimate = solve(matches, state, cloth_unknowns=True, iterations=20)
    assert estimate.parameters[1] == pytest.approx(0.5)
    costs = [energies_of(before, MODEL, matches, state, found)["data"] for found in (estimate, unmoved)]
    assert costs[0] < costs[1]


@pytest.mark.parametrize(
    ("swell", "slope", "held"),  # of the energy by the second parameter, from 0 to 0.5
    [(0.0, 1.0, True), (0.0, -1.0, False), (0.5, -1.0, True), (0.5, 1.0, False), (0.2, 1.0, False)],
)
def test_a_parameter_is_held_where_its_way_down_leads_out_of_its_bounds(swell: float, slope: float, held: bool) -> None:
    root = np.random.default_rng(0).normal(size=(20, 20))
    whole = Equations(root @ root.T, np.append(np.ones(19), slope), 3.0)
    guess = Guess(make_pose(0), MODEL.drape(make_pose(0), np.array([0.2, swell]), Past()))
    found = ClothMotion(MODEL, Past(), True).within_bounds(whole, guess)
    alone = np.outer(np.arange(20) != 19, np.arange(20) != 19) | (np.eye(20) > 0)  # it is coupled to nothing
    np.testing.assert_array_equal(found.hessian, np.where(alone, whole.hessian, 0.0) if held else whole.hessian)
    assert found.gradient.tolist() == [1.0] * 19 + [0.0 if held else slope]


def test_each_parameter_is_held_by_its_own_slope() -> None:
    guess = Guess(make_pose(0), MODEL.drape(make_pose(0), np.array([-1.0, 0.2]), Past()))
    found = ClothMotion(MODEL, Past(), True).within_bounds(
        Equations(np.eye(20), np.append(np.ones(19), -1), 0.0), guess
    )
    assert found.gradient[18:].tolist() == [0.0, -1.0]  # only the first stands at a bound


def test_a_parameter_without_a_range_is_held() -> None:
    assert at_bound(np.array([0.3]), np.zeros(1), np.array([0.3]), np.array([0.3])).all()


def test_forces_that_nothing_shows_go_to_calm_and_are_as_unsure_as_stated() -> None:
    truth, given = make_pose(0), np.array([0.2, 0.3])
    matches, state = make_matches(truth, given, np.arange(0)), clothed_state(truth, given)
    estimate = solve(matches, state, cloth_unknowns=True, cloth_sd=0.06)
    assert estimate.parameters == pytest.approx(MODEL.scene.neutral_parameters, abs=1e-9)
    assert np.sqrt(np.diag(estimate.covariance))[18:] == pytest.approx(0.06 * np.array([2.0, 0.5]))  # of the ranges


@pytest.mark.parametrize("slow", ["take_up", "thickness_m"])
def test_what_follows_the_recording_is_left_to_the_cloth_fitter(slow: str) -> None:
    truth, given = make_pose(0), np.array([0.2, 0.3])
    folding = replace(MODEL, scene=replace(MODEL.scene, garment=replace(garment(), parameter_names=("lean", slow))))
    matches, state = make_matches(truth, given, np.arange(COUNT)), clothed_state(truth, np.array([0.1, 0.1]))
    solver = TwistGaussNewton(**{**EXACT, "cloth_sd": 1e6, "cloth_unknowns": True})
    estimate = solver.solve(lambda _: matches, state, folding, [], Past(), TURN)
    assert estimate.parameters[1] == 0.1
    assert estimate.parameters[0] != 0.1


def test_the_garment_is_draped_anew_at_each_pose_it_is_matched_at() -> None:
    truth, given = make_pose(0), np.array([0.2, 0.3])
    matches, seen = make_matches(truth, given, np.arange(0)), []

    def match(surface: Surface) -> Matches:
        seen.append(surface)
        return matches

    TwistGaussNewton(iterations=3).solve(match, clothed_state(make_pose(1), given), MODEL, [], Past(), TURN)
    local = [np.linalg.inv(s.joints[0]) @ np.column_stack([s.vertices[300:], np.ones(COUNT)]).T for s in seen]
    assert len(seen) > 1 and np.ptp([shape[0, 0] for shape in local]) > 1e-6
