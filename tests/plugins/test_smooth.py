from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_sequence.banded import difference_weights, minimise
from mocapflow_sequence.smooth import Smooth, _about
from results_scene import ball_body, make_track, start_pose, stepping

from mocapflow.assets import Body
from mocapflow.geometry import angles, kinematics, twists
from mocapflow.records import F64
from mocapflow.results import Track
from mocapflow.scene import Scene
from mocapflow.series import BLOCK, Numbers, Series, blocks

DEMO = Path(__file__).parents[2] / "examples" / "data"


def smoothed_by_default(track: Track, body: Body | None = None) -> Track:
    return Smooth().run(track=track, scene=Scene(cameras=(), body=body or ball_body()))


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=0))


def true_curves(clip: str) -> np.ndarray:
    lines = (DEMO / clip / "truth" / "angles.csv").read_text().splitlines()[1:]
    return np.radians(np.array([line.split(",") for line in lines], np.float64)[:, 1:])


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
@pytest.mark.parametrize("sd_deg", [0.3, 0.5, 1.0])
def test_costs_less_than_015_degrees_on_true_curves(clip: str, sd_deg: float) -> None:
    curves = true_curves(clip)
    track = make_track(np.tile(np.eye(4), (len(curves), 1, 1)), curves, sd=np.radians(sd_deg))
    smoothed = smoothed_by_default(track)
    assert np.degrees(rms(smoothed.angles - curves)).max() < 0.15


def test_reduces_noise_at_high_frame_rates() -> None:
    rng = np.random.default_rng(0)
    curves = true_curves("skirt_steps")
    fine = np.stack([np.interp(np.arange(0, 59, 0.25), np.arange(60), c) for c in curves.T], 1)
    noisy = fine + np.radians(0.7) * rng.normal(size=fine.shape)
    track = make_track(np.tile(np.eye(4), (len(fine), 1, 1)), noisy, sd=np.radians(0.7), fps=120)
    smoothed = smoothed_by_default(track)
    assert rms(smoothed.angles - fine).mean() < 0.75 * rms(noisy - fine).mean()
    assert smoothed.raw_angles is not None and (smoothed.raw_angles == noisy).all()


def test_a_root_keeps_the_motion_of_people_and_loses_noise() -> None:
    """It turns this way and that once a second, by 17 degrees, and moves by 6 cm."""
    rng, time = np.random.default_rng(6), np.arange(0, 3, 1 / 120)
    sway = np.sin(2 * np.pi * time)[:, None]
    still, turned = np.zeros((len(time), 3)), 0.3 * sway * np.array([0.0, 0.0, 1.0])
    true = twists.exp(np.concatenate([turned, still], axis=1))
    true[:, :3, 3] = 0.06 * sway * np.array([1.0, 0.0, 0.0])
    noise = 0.01 * rng.normal(size=(2, len(time), 3))
    noisy = twists.exp(np.concatenate([noise[0], still], axis=1)) @ true
    noisy[:, :3, 3] = true[:, :3, 3] + noise[1]
    body = replace(ball_body(), positions=ball_body().positions - ball_body().positions[0])
    smoothed, kept = (
        smoothed_by_default(make_track(root, np.zeros((len(root), 1)), sd=0.01, fps=fps), body)
        for root, fps in ((noisy, 120), (true[::4], 30))
    )
    for off in (turn_between, shift_between):
        assert rms(off(smoothed.root, true)) < 0.45 * rms(off(noisy, true))
        assert off(kept.root, true[::4]).max() < 5e-4  # rad, m


def turn_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the angles (T,) in rad between rotations."""
    return np.linalg.norm(twists.log_rotation(one[:, :3, :3] @ np.swapaxes(other[:, :3, :3], 1, 2)), axis=1)


def shift_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the distances (T,) in m between origins."""
    return np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1)


@pytest.mark.parametrize("gap", [1, 4])
def test_constant_velocity_is_left_alone(gap: int) -> None:
    steps = np.cumsum(np.where(np.arange(20) == 8, gap, 1))[:, None]
    root = twists.exp(steps * np.array([[0.0, 0.0, 0.1, 0.0, 0.0, 0.0]]))
    root[:, :3, 3] = steps * np.array([0.01, 0.02, 0.0]) + [3.0, 5.0, 1.0]
    track = replace(make_track(root, steps * 0.01 * np.ones((1, 4))), time=steps[:, 0] / 30)
    smoothed = smoothed_by_default(track)
    assert np.abs(smoothed.root - root).max() < 1e-9
    assert np.abs(smoothed.angles - track.angles).max() < 1e-9


def test_where_rest_has_its_origin_does_not_matter() -> None:
    body, rng, shift = ball_body(), np.random.default_rng(3), np.array([0.0, 0.0, -1.0])
    track = stepping(body)
    noise = twists.exp(
        np.concatenate([0.05 * rng.normal(size=(len(track.root), 3)), np.zeros((len(track.root), 3))], 1)
    )
    shaken = replace(track, root=track.root @ noise)
    there = shaken.root.copy()
    there[:, :3, 3] -= there[:, :3, :3] @ shift
    moved = replace(body, positions=body.positions + shift)
    here, other = smoothed_by_default(shaken, body), smoothed_by_default(replace(shaken, root=there), moved)
    assert np.abs(here.root - shaken.root).max() > 1e-3
    assert here.raw_root is not None and (here.raw_root == shaken.root).all()
    np.testing.assert_allclose(other.root[:, :3, :3], here.root[:, :3, :3], atol=1e-9)
    places = kinematics.root_position(moved, other.root), kinematics.root_position(body, here.root)
    np.testing.assert_allclose(*places, atol=1e-9)


def test_which_way_the_world_is_turned_does_not_matter() -> None:
    track, rng = stepping(ball_body()), np.random.default_rng(4)
    noise = 0.1 * rng.normal(size=(len(track.root), 6)) * [1, 1, 1, 0, 0, 0]
    shaken = replace(track, root=track.root @ twists.exp(noise))
    turn = twists.exp(np.array([0.5, -0.8, 1.1, 0.0, 0.0, 0.0]))
    here, there = smoothed_by_default(shaken), smoothed_by_default(replace(shaken, root=turn @ shaken.root))
    assert np.abs(here.root - shaken.root).max() > 1e-2
    np.testing.assert_allclose(there.root, turn @ here.root, atol=1e-9)


def test_lost_frame_is_bridged_and_uncertain() -> None:
    body = ball_body()
    track = stepping(body)
    wrong = track.angles.copy()
    wrong[10] += 1.0
    shifted = track.root.copy()
    shifted[10, :3, 3] += 0.5
    turns = track.iterations.copy()
    turns[10] = 0  # the loop kept the prediction
    lost = replace(track, angles=wrong, root=shifted, iterations=turns)
    smoothed = smoothed_by_default(lost)
    assert np.degrees(np.abs(smoothed.angles[10] - track.angles[10])).max() < 1.0
    assert np.abs(smoothed.root[10] - track.root[10]).max() < 1e-3
    sd = angles.measure(body, smoothed.root, smoothed.angles, smoothed.covariance).sd[:, 0]
    assert sd[10] > 1.5 * sd[9]
    assert np.isfinite(smoothed.covariance).all()


def test_a_bridge_is_as_unsure_wherever_the_world_has_its_origin() -> None:
    body, track = ball_body(), stepping(ball_body())
    size, turns = 6 + track.angles.shape[1], np.where(np.arange(len(track.root)) == 10, 0, 3).astype(np.int16)
    spreads = []
    for shift in (np.zeros(3), np.array([3.0, -2.0, 1.0])):
        root = track.root.copy()
        root[:, :3, 3] += shift
        about = _about(kinematics.root_position(body, root), size)
        back = np.linalg.inv(about)  # of increments about the root joint, sure to 0.01 in each
        covariance = 1e-4 * back @ np.swapaxes(back, 1, 2)
        smoothed = smoothed_by_default(replace(track, root=root, covariance=covariance, iterations=turns))
        spreads.append(about[10] @ smoothed.covariance[10] @ about[10].T)
    np.testing.assert_allclose(*spreads, atol=1e-12)


def test_a_bridge_is_as_unsure_wherever_the_frame_was_wrongly_believed() -> None:
    track = stepping(ball_body())
    turns = np.where(track.frame == 10, 0, 3).astype(np.int16)
    spreads = []
    for shift in (0.0, 0.5):
        root = track.root.copy()
        root[10, :3, 3] += shift
        spreads.append(smoothed_by_default(replace(track, root=root, iterations=turns)).covariance[10])
    np.testing.assert_allclose(*spreads, atol=1e-7)


def test_weights_by_covariance() -> None:
    track = make_track(np.tile(np.eye(4), (30, 1, 1)), np.zeros((30, 2)), sd=np.radians(0.5), fps=100)
    spiked, covariance = track.angles.copy(), track.covariance.copy()
    spiked[15] = 0.1
    covariance[15, 6, 6] *= 400  # the first angle is uncertain there, the second is not
    smoothed = smoothed_by_default(replace(track, angles=spiked, covariance=covariance))
    assert smoothed.angles[15, 0] < 0.2 * smoothed.angles[15, 1]


def test_cloth_goes_with_the_root() -> None:
    rng = np.random.default_rng(1)
    root = np.tile(np.eye(4), (8, 1, 1))
    root[:, :3, 3] += 0.01 * rng.normal(size=(8, 3))
    track = make_track(root, np.zeros((8, 1)), sd=0.1, cloth=1)
    track = replace(track, cloth=root[:, None, :3, 3].copy())
    smoothed = smoothed_by_default(track)
    assert np.allclose(smoothed.cloth[:, 0], smoothed.root[:, :3, 3], atol=1e-12)


@pytest.mark.parametrize("count", [3, 7, BLOCK, BLOCK + 1, BLOCK + 2, 2 * BLOCK + 1, 2 * BLOCK + 7])
def test_solution_is_the_least_squares_minimum_and_its_covariance(count: int) -> None:
    """Whether it is solved at once or in blocks, of which the last may have two frames."""
    rng, size = np.random.default_rng(2), 3
    factors = rng.normal(size=(count, size, size))
    covariance = factors @ np.swapaxes(factors, 1, 2) + np.eye(size)
    time = np.cumsum(rng.uniform(0.5, 1.5, count))
    acceleration, limits = rng.normal(size=(count - 2, size)), rng.uniform(0.5, 2, size)
    wanted = rng.random(count) < 0.5
    got, smoothed = minimise(covariance, acceleration, limits, time, wanted)
    weights = difference_weights(time)
    second = np.zeros((count - 2, count))
    for k in range(3):
        second[np.arange(count - 2), np.arange(count - 2) + k] = weights[:, k]
    operator = np.kron(second, np.eye(size))
    precision = np.kron(np.eye(count - 2), np.diag(1 / limits**2))
    blocks = np.zeros((count * size, count * size))
    for t in range(count):
        blocks[t * size : (t + 1) * size, t * size : (t + 1) * size] = np.linalg.inv(covariance[t])
    hessian = blocks + operator.T @ precision @ operator
    expected = np.linalg.solve(hessian, -operator.T @ precision @ acceleration.ravel())
    np.testing.assert_allclose(got.ravel(), expected, atol=1e-7)
    each = np.linalg.inv(hessian).reshape(count, size, count, size)
    np.testing.assert_allclose(smoothed, each[wanted, :, wanted], atol=1e-7)


def test_three_samples_give_the_acceleration_of_a_parabola_however_far_apart() -> None:
    time = np.cumsum(np.random.default_rng(5).uniform(0.5, 2.0, 9))
    three = np.lib.stride_tricks.sliding_window_view(3 * time**2 - 2 * time + 1, 3)
    np.testing.assert_allclose(np.sum(difference_weights(time) * three, axis=1), 6.0)


def test_two_frames_are_returned_as_they_are() -> None:
    body = ball_body(("pelvis", "hip_l", "knee_l", "ankle_l"))
    pose = start_pose(body)
    track = make_track(np.tile(pose.root, (2, 1, 1)), np.tile(pose.angles, (2, 1)))
    smoothed = smoothed_by_default(track)
    assert (smoothed.angles == track.angles).all() and (smoothed.root == track.root).all()
    assert smoothed.raw_angles is not None and smoothed.raw_root is not None  # a report compares before and after


def test_three_frames_bend_less() -> None:
    """As in a parabola through them all move alike, the middle twice as far, the other way."""
    body = ball_body(("pelvis", "hip_l", "knee_l", "ankle_l"))
    pose = start_pose(body)
    angles = pose.angles + np.radians([[0.0], [1.0], [0.0]]) * np.eye(len(pose.angles))[0]
    track = make_track(np.tile(pose.root, (3, 1, 1)), angles)
    before, middle, after = np.degrees(smoothed_by_default(track).angles - track.angles)[:, 0]
    assert (before, after) == pytest.approx((-middle / 2, -middle / 2)) and -2 / 3 < middle < -0.01


def test_a_variance_that_rounding_left_below_zero_is_no_hindrance() -> None:
    curves = true_curves("skirt_steps")[:20]
    track = make_track(np.tile(np.eye(4), (20, 1, 1)), curves, sd=np.radians(1.0))
    covariance = track.covariance.copy()
    covariance[7, -1, -1] = -1e-6
    smoothed = smoothed_by_default(replace(track, covariance=covariance))
    assert np.isfinite(smoothed.angles).all()
    assert np.degrees(np.abs(smoothed.angles - curves)).max() < 1


def test_what_is_wide_is_never_in_memory_as_a_whole() -> None:
    curves = true_curves("skirt_steps")[np.arange(3 * BLOCK) % 60]
    track = make_track(np.tile(np.eye(4), (len(curves), 1, 1)), curves, sd=np.radians(1.0), cloth=5)
    turns = track.iterations.copy()
    turns[[70, 71]] = 0  # lost

    def block_by_block(values: F64) -> Series:
        def rows(numbers: Numbers) -> F64:
            assert len(numbers) <= BLOCK + 1
            return values[numbers]

        return Series(values.shape, rows)

    wrong = track.angles.copy()
    wrong[[70, 71]] += 1.0
    plain = replace(track, angles=wrong, iterations=turns)
    wide = replace(plain, covariance=block_by_block(track.covariance), cloth=block_by_block(track.cloth))
    expected, smoothed = smoothed_by_default(plain), smoothed_by_default(wide)
    np.testing.assert_array_equal(smoothed.angles, expected.angles)
    assert np.degrees(np.abs(smoothed.angles - curves)[[70, 71]]).max() < 5  # of 57: bridged in a later block too
    for part in blocks(len(curves)):
        np.testing.assert_array_equal(smoothed.covariance[part], expected.covariance[part])
        np.testing.assert_array_equal(smoothed.cloth[part], expected.cloth[part])


def test_an_increment_moves_a_point_of_the_root_as_its_twist_does() -> None:
    random = np.random.default_rng(2)
    points, increment = random.normal(size=(3, 3)), 1e-6 * random.normal(size=8)
    moved = (_about(points, 8) @ increment)[:, 3:6]
    motion = twists.exp(increment[:6])
    np.testing.assert_allclose(moved, points @ motion[:3, :3].T + motion[:3, 3] - points, atol=1e-11)
    kept = [0, 1, 2, 6, 7]
    np.testing.assert_array_equal((_about(points, 8) @ increment)[:, kept], np.tile(increment[kept], (3, 1)))
