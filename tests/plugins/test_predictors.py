"""Predictors go on as before, over the time that really passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_priors.constant_acceleration import ConstantAcceleration
from mocapflow_priors.constant_velocity import ConstantVelocity
from mocapflow_priors.hold import Hold
from test_priors import make_past
from twist_fixtures import make_pose, make_scene

from mocapflow.data import NO_CLOTH, Frame, Moment, Past, Pose
from mocapflow.model import moved

STEP = np.concatenate([[0.1, 0.2, -0.3, 0.01, 0.03, 0.02], np.full(12, 0.05)])
FIRST = make_pose(0)
SECOND = moved(FIRST, STEP)


def frame(time: float) -> Frame:
    return Frame(index=2, time=time, images=(), usable=np.empty(0, bool))


def test_hold_keeps_the_last_pose() -> None:
    assert Hold().predict(frame(2 / 30), make_past(FIRST, SECOND), make_scene()) is SECOND


@pytest.mark.parametrize("steps", [1.0, 3.0])
def test_constant_velocity_repeats_the_motion_as_often_as_frames_passed(steps: float) -> None:
    guess = ConstantVelocity().predict(frame((1 + steps) / 30), make_past(FIRST, SECOND), make_scene())
    truth = SECOND
    for _ in range(int(steps)):
        truth = moved(truth, STEP)
    assert np.allclose(guess.root, truth.root, atol=1e-12) and np.allclose(guess.angles, truth.angles)


def test_a_share_of_the_velocity_can_be_kept() -> None:
    half = ConstantVelocity(kept=0.5).predict(frame(2 / 30), make_past(FIRST, SECOND), make_scene())
    assert np.allclose(half.angles, SECOND.angles + 0.025)


@pytest.mark.parametrize("rate", [10.0, 30.0, 120.0])
def test_while_nothing_is_seen_the_motion_dies_away_at_any_frame_rate(rate: float) -> None:
    speed, lasts = 6.0, 0.05  # rad/s, s
    slow = moved(FIRST, np.full(18, speed / rate))
    past = make_past(FIRST, slow, 1 / rate)
    for index in range(2, int(rate) + 2):  # a second
        pose = ConstantVelocity().predict(frame(index / rate), past, make_scene())
        past = past.after(Moment(time=index / rate, pose=pose, cloth=NO_CLOTH, observed=np.zeros(12)), {})
    steps = 1 / (1 - np.exp(-1 / rate / lasts))  # of a geometric series: the first whole, each after it less
    assert past.moments[-1].pose.angles - slow.angles == pytest.approx(speed / rate * steps, rel=1e-6)


def test_who_is_seen_again_does_not_go_on_from_where_nobody_saw_him() -> None:
    first, second = make_past(FIRST, SECOND).moments
    blind, seen = replace(first, observed=np.zeros(12)), replace(second, observed=np.ones(12))
    assert ConstantVelocity().predict(frame(2 / 30), Past(moments=(blind, seen)), make_scene()) is SECOND


def test_an_angle_that_jumped_does_not_go_on() -> None:
    jump = np.zeros(18)
    jump[6:8] = np.radians([35.0, 45.0])  # in a thirtieth of a second: a kick, and more than that
    guess = ConstantVelocity().predict(frame(2 / 30), make_past(FIRST, moved(FIRST, jump)), make_scene())
    assert np.allclose(np.degrees(guess.angles - FIRST.angles)[:3], [70.0, 45.0, 0.0])


@pytest.mark.parametrize(("speed_deg_s", "goes_on"), [(1150.0, True), (1250.0, False)])
def test_an_angle_jumps_if_it_is_faster_than_a_kick_however_late_that_is(speed_deg_s: float, goes_on: bool) -> None:
    turned = np.eye(len(FIRST.angles))[2] * np.radians(speed_deg_s) / 30
    poses = (FIRST, Pose(root=FIRST.root, angles=FIRST.angles + turned))
    late = Past(moments=tuple(Moment(time=20 + k / 30, pose=pose, cloth=NO_CLOTH) for k, pose in enumerate(poses)))
    predicted = ConstantVelocity().predict(frame(20 + 2 / 30), late, make_scene())
    np.testing.assert_allclose(predicted.angles, FIRST.angles + (2 if goes_on else 1) * turned, atol=1e-9)


def test_an_angle_that_is_seen_again_does_not_go_on() -> None:
    """Where it was before is what the priors said."""
    hidden = np.arange(12) < 3
    behind, before = np.where(hidden, 0.1, 0.9), np.where(hidden, 0.8, 0.9)

    def moved_on(*observed: np.ndarray) -> np.ndarray:
        moments = zip(make_past(FIRST, SECOND).moments, observed, strict=True)
        past = Past(moments=tuple(replace(moment, observed=share) for moment, share in moments))
        return ConstantVelocity().predict(frame(2 / 30), past, make_scene()).angles - SECOND.angles

    assert moved_on(behind, before) == pytest.approx(np.where(hidden, 0.0, 0.05))
    assert moved_on(behind, behind) == pytest.approx(0.05)  # a hidden limb goes on
    assert moved_on(before, behind) == pytest.approx(0.05)  # and so does one that disappears


def test_one_frame_or_equal_times_give_the_last_pose() -> None:
    one = Past(moments=(Moment(time=0.0, pose=FIRST, cloth=NO_CLOTH),))
    assert ConstantVelocity().predict(frame(1 / 30), one, make_scene()) is FIRST
    assert ConstantVelocity().predict(frame(1 / 30), make_past(FIRST, SECOND, 0.0), make_scene()) is SECOND


def thrown(*times: float) -> Past:
    """Return a past in which the root falls and every angle turns faster and faster: both go with the time squared."""
    return Past(moments=tuple(Moment(time=t, pose=at(t), cloth=NO_CLOTH) for t in times))


def at(time: float) -> Pose:
    return moved(FIRST, np.concatenate([[0.0, 0.0, -4.9, 0.0, 0.0, 0.0], np.full(12, 3.0)]) * time**2)


@pytest.mark.parametrize("times", [(0.0, 0.1, 0.2, 0.3), (0.0, 0.1, 0.3, 0.5), (0.0, 0.1, 0.2, 0.4)])
def test_constant_acceleration_follows_a_parabola(times: tuple[float, ...]) -> None:
    guess = ConstantAcceleration(kept=1.0).predict(frame(times[-1]), thrown(*times[:-1]), make_scene())
    assert np.allclose(guess.root, at(times[-1]).root, atol=1e-12) and np.allclose(guess.angles, at(times[-1]).angles)


def test_a_share_of_the_acceleration_can_be_kept() -> None:
    past, scene = thrown(0.0, 0.1, 0.2), make_scene()
    guesses = [ConstantAcceleration(kept=kept).predict(frame(0.3), past, scene).angles for kept in (0.0, 0.4, 1.0)]
    assert guesses[0] == pytest.approx(ConstantVelocity().predict(frame(0.3), past, scene).angles)
    assert guesses[1] == pytest.approx(0.6 * guesses[0] + 0.4 * guesses[2])


@pytest.mark.parametrize(("change_deg", "goes_on"), [(16.0, True), (18.0, False)])
def test_a_jump_of_the_velocity_does_not_go_on(change_deg: float, goes_on: bool) -> None:
    slow, fast = (np.concatenate([np.zeros(6), np.full(12, np.radians(deg))]) for deg in (2.0, 2.0 + change_deg))
    second = moved(FIRST, slow)
    moments = (Moment(time=k / 30, pose=p, cloth=NO_CLOTH) for k, p in enumerate((FIRST, second, moved(second, fast))))
    past = Past(moments=tuple(moments))
    steady, bent = (
        p.predict(frame(0.1), past, make_scene()).angles for p in (ConstantVelocity(), ConstantAcceleration())
    )
    assert np.degrees(bent - steady) == pytest.approx(0.4 * change_deg if goes_on else 0.0)


def test_an_acceleration_is_not_believed_where_a_limb_jumped_or_nothing_showed_it() -> None:
    moments = list(thrown(0.0, 0.1, 0.2).moments)
    jump = replace(moments[0].pose, angles=moments[0].pose.angles - 2.5 * (np.arange(12) == 3))
    jumped = Past(moments=(replace(moments[0], pose=jump), *moments[1:]))
    blind = Past(moments=(replace(moments[0], observed=np.zeros(12)), *moments[1:]))
    by_speed, by_change = (
        predictor.predict(frame(0.3), jumped, make_scene()).angles
        for predictor in (ConstantVelocity(), ConstantAcceleration(kept=1.0))
    )
    assert (by_speed == by_change).tolist() == (np.arange(12) == 3).tolist()
    for past in (blind, thrown(0.1, 0.2), thrown(0.1, 0.1, 0.2)):
        steady, bent = (p.predict(frame(0.3), past, make_scene()) for p in (ConstantVelocity(), ConstantAcceleration()))
        assert np.array_equal(bent.root, steady.root) and np.array_equal(bent.angles, steady.angles)
