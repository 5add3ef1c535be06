"""Strides, and figures over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mocapflow_evaluation import compare, cycles
from mocapflow_evaluation.cycles import Cycle, gait_cycles
from mocapflow_evaluation.evaluate import evaluate
from mocapflow_evaluation.stick import Stick
from mocapflow_evaluation.tracked_motion import TrackedMotion
from mocapflow_export import layout, tables
from results_scene import DEMO

RATE = 60.0
NAMES = tuple(f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in ("l", "r"))


def walking(speed: float, lift: float = 0.05, bearing: float = 0.0, seconds: float = 5.0) -> np.ndarray:
    """Return joints of legs that swing once a second, the left heel striking at 0.25 s: (T, 6, 3) m."""
    time = np.arange(int(seconds * RATE)) / RATE
    forward, left = np.array([np.cos(bearing), np.sin(bearing), 0]), np.array([-np.sin(bearing), np.cos(bearing), 0])
    places = []
    for joint, reach, height in (("hip", 0.0, 0.9), ("knee", 0.15, 0.5), ("ankle", 0.3, 0.1)):
        for sign in (1, -1):
            swing = sign * reach * np.sin(2 * np.pi * time)
            raised = lift * np.maximum(0, sign * np.cos(2 * np.pi * time)) if joint == "ankle" else 0 * time
            up = np.array([0, 0, 1.0])
            places.append(
                (speed * time + swing)[:, None] * forward + sign * 0.1 * left + (height + raised)[:, None] * up
            )
    return np.stack(places, axis=1)


@pytest.mark.parametrize("size", [0.4, 1.0, 2.5])
@pytest.mark.parametrize(("speed", "bearing"), [(0.0, 0.0), (1.3, 0.0), (1.3, 2.0)])
def test_heel_strikes_on_a_treadmill_and_over_ground(speed: float, bearing: float, size: float) -> None:
    found = gait_cycles(NAMES, size * walking(speed, bearing=bearing), RATE)
    left = [cycle.first for cycle in found if cycle.side == "l"]
    right = [cycle.first for cycle in found if cycle.side == "r"]
    np.testing.assert_allclose(np.array(left) / RATE, np.arange(4) + 0.25, atol=0.02)
    np.testing.assert_allclose(np.array(right) / RATE, np.arange(4) + 0.75, atol=0.02)
    assert all(cycle.last - cycle.first == RATE for cycle in found)


def test_strikes_of_a_foot_are_half_a_second_apart_or_more() -> None:
    places = walking(1.3)
    assert len(gait_cycles(NAMES, places, RATE / 0.6)) == 8  # every stride, if one takes 0.6 s
    assert min(cycle.last - cycle.first for cycle in gait_cycles(NAMES, places, 3 * RATE)) == 2 * RATE  # not of a third
    assert gait_cycles(NAMES, places, RATE / 2.6) == []  # nobody walks so slowly


@pytest.mark.usefixtures("undrawn")
def test_strides_are_told_and_have_their_rows(tmp_path: Path) -> None:
    places = walking(1.3, seconds=4.5)
    frame = np.arange(float(len(places)))
    columns = {"frame": frame, "time": frame / RATE, "knee_flexion_l": 30 * np.sin(frame / 8)}
    truth = tables.write_columns(tmp_path / "t.csv", columns)
    own = TrackedMotion(columns=columns, raw=columns, stick=Stick(names=NAMES, places=places))
    got = evaluate(own, truth, tmp_path)
    assert got.notes == ("strides, by heel strikes in our own joint centres: 4 left, 3 right",)
    assert got.rows[0]["cycles"] == len((tmp_path / layout.CYCLES).read_text().splitlines()) - 1 == 4


def test_knees_raised_on_the_spot_are_no_strides() -> None:
    found = np.load(DEMO / "truth" / "joints.npz")
    assert gait_cycles([str(name) for name in found["names"]], found["positions"], 30.0) == []


@pytest.mark.parametrize("size", [0.4, 1.0, 2.5])
def test_a_leg_that_is_raised_where_it_is_ahead_takes_no_strides(size: float) -> None:
    """It swings as far forward and back as that of somebody who walks."""
    places = size * walking(0.0)
    assert gait_cycles(NAMES, places, RATE)
    ahead = np.maximum(0, np.sin(2 * np.pi * np.arange(len(places)) / RATE))  # of the left leg
    for side, share in (("l", ahead), ("r", np.roll(ahead, int(RATE) // 2))):
        places[:, NAMES.index(f"ankle_{side}"), 2] += 0.3 * size * share  # m
    assert gait_cycles(NAMES, places, RATE) == []


def test_somebody_who_sways_takes_no_strides() -> None:
    places = walking(0.0)
    assert gait_cycles(NAMES, places.mean(axis=0) + 0.2 * (places - places.mean(axis=0)), RATE) == []  # 6 cm either way


def test_joints_that_are_not_there_have_no_strides() -> None:
    assert gait_cycles(("hip_l",), np.zeros((5, 1, 3)), RATE) == []


def test_every_stride_of_its_own_side_has_a_row() -> None:
    frame = np.arange(100.0)
    curve = 30 * np.sin(frame / 8)
    known = {"knee_flexion_l": np.where(frame < 90, curve - 2, np.nan), "knee_flexion_r": curve}
    own = {"frame": frame + 7, "knee_flexion_l": curve, "knee_flexion_r": curve}
    strides = [Cycle("l", 0, 50), Cycle("r", 25, 75), Cycle("l", 50, 99), Cycle("l", 89, 99)]  # one frame of the last
    rows = cycles.rows(strides, own, known)
    assert [(row["angle"], row["cycle"], row["first_frame"], row["frames"]) for row in rows] == [
        ("knee_flexion_l", 1, 7, 51), ("knee_flexion_l", 2, 57, 40), ("knee_flexion_r", 1, 32, 51),
    ]  # fmt: skip
    assert rows[0]["rms_deg"] == pytest.approx(2) and rows[0]["offset_deg"] == pytest.approx(2)
    assert rows[1]["rom_deg"] == rows[1]["rom_reference_deg"] == pytest.approx(np.ptp(curve[50:90]))
    assert rows[0]["peak_deg"] - rows[0]["peak_reference_deg"] == pytest.approx(2)
    assert rows[2]["cmc"] == pytest.approx(1)


def test_a_stride_is_stretched_to_a_hundred_per_cent() -> None:
    curve = np.arange(100.0)
    (stretched,) = cycles.normalised([Cycle("l", 20, 70)], curve, "ankle_l")
    np.testing.assert_allclose(stretched, np.linspace(20, 70, 101))
    assert np.isnan(cycles.across([], curve, curve, "ankle_l"))


def test_across_strides_counts_those_that_both_have() -> None:
    curve, strides = 20 * np.sin(np.arange(100) / 8), [Cycle("l", 0, 50), Cycle("l", 50, 99), Cycle("r", 0, 50)]
    assert cycles.across(strides, curve, curve, "ankle_l") == pytest.approx(1)
    partly = np.where(np.arange(100) < 80, curve - 3, np.nan)
    (stretched,) = cycles.normalised(strides[:1], curve, "ankle_l")
    expected = compare.cmc(np.stack([stretched, stretched - 3])[None])
    assert cycles.across(strides, curve, partly, "ankle_l") == pytest.approx(expected)
    assert cycles.across(strides, curve, curve - 3, "ankle_l") == pytest.approx(
        compare.cmc(np.stack([cycles.normalised(strides[:2], each, "ankle_l") for each in (curve, curve - 3)], axis=1))
    )


def test_cmc_is_one_for_equal_curves_and_falls_with_an_offset() -> None:
    curve = 20 * np.sin(np.arange(101) / 16)
    values = [compare.cmc(np.stack([curve, curve + offset])[None]) for offset in (0.0, 2.0, 8.0)]
    assert values[0] == pytest.approx(1)
    assert values[0] > values[1] > values[2]
    assert np.isnan(compare.cmc(np.stack([curve, -curve])[None]))


def test_cmc_by_the_formula_written_out() -> None:
    """Ferrari 2010, Eq. 4: for two systems, the variance about their mean over that about the mean of the cycle."""
    random = np.random.default_rng(0)
    curves = 20 * np.sin(np.arange(50) / 8) + random.normal(size=(3, 2, 50))
    within = sum((curves[g, p, f] - curves[g, :, f].mean()) ** 2 for g in range(3) for p in range(2) for f in range(50))
    about = sum((curves[g, p, f] - curves[g].mean()) ** 2 for g in range(3) for p in range(2) for f in range(50))
    assert compare.cmc(curves) == pytest.approx(np.sqrt(1 - (within / (3 * 50)) / (about / (3 * (2 * 50 - 1)))))


def test_limits_of_agreement_hold_95_per_cent() -> None:
    error = np.random.default_rng(0).normal(1.0, 2.0, 5000)
    assert compare.agreement(np.array([0.0, 2.0]))["agreement_high_deg"] == pytest.approx(1 + 1.96 * np.sqrt(2))
    low, high = compare.agreement(error).values()
    assert (low, high) == (pytest.approx(1 - 3.92, abs=0.15), pytest.approx(1 + 3.92, abs=0.15))
    assert np.mean((error > low) & (error < high)) == pytest.approx(0.95, abs=0.01)


def test_shared_angles_are_those_that_both_have() -> None:
    curve, nothing = np.ones(3), np.full(3, np.nan)
    ours = {"frame": curve, "a": curve, "b": curve}
    assert list(cycles.shared(ours, {"a": nothing, "b": np.array([1, np.nan, 1])})) == ["b"]  # somewhere
