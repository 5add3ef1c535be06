"""Lag, sign and times of a reference."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_evaluation.alignment import Alignment, align, resampled
from mocapflow_evaluation.references import Reference

TIME = np.arange(120) / 30


def motion(time: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "knee_flexion_l": 30 + 30 * np.sin(5 * time) + 10 * np.sin(11 * time + 1),
        "knee_flexion_r": 30 - 30 * np.sin(5 * time) + 8 * np.sin(10 * time),
        "hip_flexion_l": 20 * np.sin(5 * time + 0.5),
    }


def aligned(ours: dict, theirs: dict, at: np.ndarray, longest: float = 0.5) -> Alignment:
    return align({"time": TIME, **ours}, Reference(curves=theirs, at=at, by_frame=False), longest)


@pytest.mark.parametrize("lag", [-8.3, -0.5, 0.0, 0.25, 6.75])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_common_lag_is_found_to_a_tenth_of_a_frame(lag: float, noise: float) -> None:
    random = np.random.default_rng(1)
    ours = {name: curve + random.normal(scale=noise, size=120) for name, curve in motion(TIME).items()}
    at = np.arange(-1, 6, 0.01)
    found = aligned(ours, motion(at + lag / 30), at)
    assert found.lag == pytest.approx(lag, abs=0.1)
    assert set(found.signs.values()) == {1}


def test_a_lag_is_looked_for_by_a_frame_at_least() -> None:
    assert aligned(motion(TIME), motion(TIME + 0.3 / 30), TIME, longest=0.001).lag == pytest.approx(0.3, abs=0.1)


def test_what_counts_the_other_way_is_found_beside_a_lag() -> None:
    theirs = motion(TIME + 3 / 30)
    theirs["knee_flexion_r"] = -theirs["knee_flexion_r"]
    found = aligned(motion(TIME), theirs, TIME)
    assert found.lag == pytest.approx(3, abs=0.1)
    assert found.signs == {"knee_flexion_l": 1, "knee_flexion_r": -1, "hip_flexion_l": 1}


@pytest.mark.parametrize(("correlation", "sign"), [(-0.95, -1), (-0.6, 1)])
def test_a_curve_counts_the_other_way_where_it_is_opposed_and_not_by_chance(correlation: float, sign: int) -> None:
    phase = 5 * TIME
    elbow = correlation * np.sin(phase) + np.sqrt(1 - correlation**2) * np.cos(phase)
    found = aligned(motion(TIME) | {"elbow_l": 2 * np.sin(phase)}, motion(TIME) | {"elbow_l": 3 * elbow}, TIME)
    assert found.signs == dict.fromkeys(motion(TIME), 1) | {"elbow_l": sign}


def test_what_half_a_period_explains_does_not_count_the_other_way() -> None:
    at = np.arange(-60, 180) / 30
    found = aligned({"a": np.sin(5 * TIME)}, {"a": -np.sin(5 * at)}, at, longest=0.7)
    assert found.signs == {"a": 1} and abs(found.lag) == pytest.approx(30 * np.pi / 5, abs=0.1)


def test_what_is_not_alike_has_no_lag() -> None:
    ours, theirs = np.random.default_rng(0).normal(size=(2, 120))
    found = aligned({"a": ours}, {"a": theirs}, TIME)
    assert np.isnan(found.lag) and found.signs == {"a": 1}


def test_one_frame_has_no_lag() -> None:
    one = {"time": TIME[:1], "a": TIME[:1]}
    assert np.isnan(align(one, Reference(curves={"a": TIME[:1]}, at=TIME[:1], by_frame=False), 0.5).lag)


def test_what_may_be_chance_is_not_taken_out() -> None:
    random = np.random.default_rng(0)
    ours = motion(TIME) | {"elbow_l": np.cumsum(random.normal(size=120))}
    theirs = {name: curve + np.cumsum(random.normal(size=120)) for name, curve in motion(TIME).items()}
    theirs["elbow_l"] = -0.5 * ours["elbow_l"] + 3 * np.cumsum(random.normal(size=120))
    found = aligned(ours, theirs, TIME)
    assert set(found.signs.values()) == {1}
    assert found.worth == 0
    late = aligned(motion(TIME), motion(TIME + 3 / 30), TIME)
    assert late.worth == late.lag


def test_a_few_frames_are_alike_or_opposed_by_chance() -> None:
    for count, sign in ((9, 1), (40, -1)):
        reference = Reference(curves={"a": -TIME[:count]}, at=TIME[:count], by_frame=False)
        assert align({"time": TIME[:count], "a": TIME[:count]}, reference, 0.1).signs == {"a": sign}


def test_a_lag_without_which_too_few_frames_have_both() -> None:
    at = np.arange(66, 240) / 30  # of our 120 frames 54 without the lag, 63 with it
    found = aligned(motion(TIME), motion(at - 9 / 30), at)
    assert found.worth == pytest.approx(-9, abs=0.1)


def test_a_lag_beyond_the_search_is_unknown() -> None:
    assert np.isnan(aligned({"a": TIME**2}, {"a": (TIME - 3) ** 2}, TIME, 0.2).lag)


@pytest.mark.parametrize("theirs", [{}, {"a": np.full(120, np.nan)}, {"a": np.ones(120)}])
def test_nothing_to_align(theirs: dict[str, np.ndarray]) -> None:
    found = aligned({"a": np.sin(TIME)}, theirs, TIME)
    assert np.isnan(found.lag)
    assert set(found.signs.values()) <= {1}


def test_resampled_between_samples_and_not_across_gaps() -> None:
    at = np.arange(10.0)
    values = np.where((at > 3) & (at < 7), np.nan, 2 * at)
    got = resampled(at, values, np.array([-1.0, 0.0, 1.5, 3.0, 3.5, 5.0, 7.0, 8.25, 9.01, 9.5]), 1.0)
    np.testing.assert_allclose(got, [np.nan, 0, 3, 6, np.nan, np.nan, 14, 16.5, 18, np.nan])
    assert np.isnan(resampled(at, np.full(10, np.nan), at, 1.0)).all()
    np.testing.assert_array_equal(resampled(np.array([4.0]), np.array([1.0]), np.array([3.0, 4.0]), 1.0), [np.nan, 1])


def test_nothing_is_made_up_between_samples_that_lie_farther_apart_than_usual() -> None:
    at = np.array([0.0, 0.1, 0.2, 0.4, 0.5])
    found = resampled(at, 10 * at, np.array([-0.05, 0.05, 0.3, 0.398, 0.45, 0.55]), 0.1)
    np.testing.assert_allclose(found, [np.nan, 0.5, np.nan, 3.98, 4.5, np.nan])


@pytest.mark.parametrize(
    ("lag", "gain", "worth"), [(3.0, 0.5, 3.0), (-3.0, 0.5, -3.0), (3.0, 0.1, 0.0), (0.3, 0.5, 0.0), (np.nan, 0.5, 0.0)]
)
def test_a_lag_is_taken_out_if_it_is_large_and_explains_much(lag: float, gain: float, worth: float) -> None:
    assert Alignment(lag, {}, gain).worth == worth


@pytest.mark.parametrize(("frames", "found"), [(50, False), (80, True)])
def test_a_reference_of_less_than_half_of_our_frames_shows_no_lag(frames: int, found: bool) -> None:
    theirs = {name: np.where(np.arange(120) < frames, curve, np.nan) for name, curve in motion(TIME + 3 / 30).items()}
    assert np.isfinite(aligned(motion(TIME), theirs, TIME, longest=0.2).lag) == found
