"""The loop with stub steps: it converges, it oscillates, it runs into its cap."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.assets import Camera
from mocapflow.components import PoseSolver
from mocapflow.data import NO_CLOTH, Change, Estimate, Frame, Moment, Past, Pose, empty_matches
from mocapflow.functional import Functional
from mocapflow.geometry.kinematics import chain, skin
from mocapflow.loop import Steps, settle
from mocapflow.model import ClothedModel
from mocapflow.prediction import initial_state
from mocapflow.scene import Scene
from mocapflow.steady import Steady
from tests.fixtures.tiny_plugin import TinyMatcher, TinySegmenter, tiny_body


class Towards(PoseSolver):
    """Goes a share of the way to zero: 1 arrives at once, 2 swings for ever, 0.01 creeps."""

    name = "towards"
    share: float

    def solve(self, match, state, model, priors, past, turn):
        pose = state.estimate.pose
        match(model.surface(pose, state.cloth))
        moved = Pose(root=pose.root, angles=pose.angles * (1 - self.share))
        return Estimate(pose=moved, parameters=state.estimate.parameters, covariance=np.eye(8), observed=np.ones(2))


@pytest.fixture
def frame():
    image = np.zeros((16, 24, 3), np.uint8)
    return Frame(index=5, time=0.1, images=(image, image), usable=np.ones(2, bool))


def go(frame, share, observe=lambda *_: None, max_turns=8, sigmas=(), past=None, far_turns=0, steady=None):
    camera = Camera(
        name="cam01", size=np.array([24, 16], np.int32), intrinsics=np.eye(3), distortion=np.zeros(5),
        camera_from_world=np.eye(4),
    )  # fmt: skip
    model = ClothedModel(scene=Scene(cameras=(camera, camera), body=tiny_body(1.0)))
    steps = Steps(
        segmenter=TinySegmenter(), matchers=(TinyMatcher(),), pose_solver=Towards(share=share),
        cloth_fitter=None, priors=(),
        steady=Steady(sigmas=sigmas, max_turns=max_turns, far_turns=far_turns, **(steady or {})),
    )  # fmt: skip
    pose = Pose(root=np.eye(4), angles=np.array([0.3, -0.4]))
    start = initial_state(pose, np.empty(0), model.drape(pose, np.empty(0), Past()))
    return settle(frame, start, past or Past(), steps, model, observe)


def test_converges_and_stops_after_the_wanted_number_of_calm_turns(frame):
    result = go(frame, 1.0)
    assert (result.steady, result.oscillating, result.iterations) == (True, False, 3)  # arrives, then two calm turns
    assert result.change.body == 0 and result.change.angles == 0
    assert np.allclose(result.state.estimate.pose.angles, 0)
    assert np.isfinite(result.energy).any(axis=1).tolist() == [True] * 3 + [False] * 5
    assert go(frame, 0.0).iterations == 2  # the calm turns are two in one that begins at rest, too


def test_a_swing_between_two_states_is_told_from_creeping(frame):
    swinging, creeping = go(frame, 2.0), go(frame, 0.05)
    assert (swinging.steady, swinging.oscillating, swinging.iterations) == (False, True, 8)
    assert swinging.change.angles == pytest.approx(0.8)
    assert (creeping.steady, creeping.oscillating, creeping.iterations) == (False, False, 8)


def test_what_the_pose_is_not_known_to_is_rest(frame):
    before = Past(moments=(Moment(time=0.0, pose=Pose(root=np.eye(4), angles=np.zeros(2)), cloth=NO_CLOTH),))
    result = go(frame, 0.05, sigmas=(0, 0.01), past=before)  # the stub says that angles are known to 1 rad
    assert (result.steady, result.iterations) == (True, 3)  # a turn away from the prediction, then two calm ones
    assert result.change.sigmas == pytest.approx(0.05 * 0.95**2 * 0.5 / np.sqrt(8))  # of two angles among 8 unknowns
    assert go(frame, 0.05, sigmas=(0, 0.01)).iterations == 8  # the first frame starts anywhere, and takes its time


def test_each_turn_has_its_own_measure_of_rest_and_later_ones_the_last():
    moved = Change(body=0.1, cloth=0.0, angles=0.1, sigmas=0.5)
    held = [Steady(sigmas=(0, 0.4, 0.6)).holds(moved, turns) for turns in (1, 2, 3, 4)]
    assert held == [False, False, True, True]
    assert not Steady().holds(moved, 8)


def test_a_functional_that_goes_on_changing_is_no_rest(frame, monkeypatch):
    """By 10 % of itself in each turn: the pose rests after the second, the frame only where that is within bounds."""
    costs = iter(1.1 ** np.arange(24))
    monkeypatch.setattr(Functional, "total", lambda self, values: next(costs))
    found = [go(frame, 1.0, steady=dict(energy_share=share)) for share in (0.05, 0.11, np.inf)]
    assert [(result.steady, result.iterations) for result in found] == [(False, 8), (True, 3), (True, 3)]
    assert (
        go(frame, 0.01, steady=dict(energy_share=0.11, angle_deg=1, surface_mm=100, turns=1)).iterations == 2
    )  # none before


def test_the_matches_kept_are_those_that_the_solver_explains(frame, monkeypatch):
    solve, said = Towards.solve, empty_matches()
    assert len(go(frame, 1.0).state.matches.weight)  # where it does not say: those of the surface
    monkeypatch.setattr(Towards, "solve", lambda self, *given: replace(solve(self, *given), matches=said))
    assert go(frame, 1.0).state.matches is said


def test_the_cap_holds(frame):
    assert go(frame, 0.05, max_turns=3).iterations == 3


def test_a_frame_that_begins_like_a_first_may_take_more_turns(frame):
    before = Past(moments=(Moment(time=0.0, pose=Pose(root=np.eye(4), angles=np.zeros(2)), cloth=NO_CLOTH),))
    first, later = (go(frame, 0.05, max_turns=3, far_turns=6, past=past) for past in (Past(), before))
    assert (first.iterations, later.iterations) == (6, 3)
    assert len(first.energy) == len(later.energy) == 6  # as long in every frame: the rows of one array
    assert go(frame, 0.05, max_turns=3, far_turns=2).iterations == 3


@pytest.mark.parametrize(("far_mm", "turns"), [(1, 6), (1000, 3)])
def test_a_frame_whose_first_turn_moves_the_body_far_is_one_that_began_far_off(frame, far_mm, turns):
    """It may take more turns, what it is known to is no rest, and every later turn says so."""
    before = Past(moments=(Moment(time=0.0, pose=Pose(root=np.eye(4), angles=np.zeros(2)), cloth=NO_CLOTH),))
    seen = []
    steady = dict(far_mm=far_mm)
    result = go(frame, 0.05, lambda *args: seen.append(args[1].far), 3, (0, 0.01), before, far_turns=6, steady=steady)
    assert result.iterations == turns
    assert seen == ([False, *[True] * 5] if far_mm == 1 else [False] * 3)
    assert len(result.energy) == 6


def test_the_only_turn_of_a_frame_is_the_last_however_far_it_moves(frame):
    before = Past(moments=(Moment(time=0.0, pose=Pose(root=np.eye(4), angles=np.zeros(2)), cloth=NO_CLOTH),))
    assert go(frame, 0.5, max_turns=1, past=before, steady=dict(far_mm=1)).iterations == 1


def test_onlookers_see_every_turn_in_order(frame):
    seen = []
    result = go(frame, 1.0, lambda index, turn, state: seen.append((index, turn.index, state)))
    assert [s[:2] for s in seen] == [(5, 0), (5, 1), (5, 2)]
    assert seen[-1][2] is result.state


def test_the_change_is_the_largest_move_of_the_surface(frame):
    result = go(frame, 0.05, max_turns=1)
    poses = [Pose(root=np.eye(4), angles=share * np.array([0.3, -0.4])) for share in (1.0, 0.95)]
    moved = [skin(tiny_body(1.0), chain(tiny_body(1.0), pose)[0], pose.angles) for pose in poses]
    assert result.change.angles == pytest.approx(0.05 * 0.4)
    assert result.change.body == pytest.approx(np.linalg.norm(moved[1] - moved[0], axis=1).max())
    np.testing.assert_allclose(result.change.shift, moved[1] - moved[0], atol=1e-12)


def test_cpu_seconds_of_every_step_are_measured(frame):
    assert set(go(frame, 1.0).seconds) == {"segment", "solve", "cloth", "energy"}
