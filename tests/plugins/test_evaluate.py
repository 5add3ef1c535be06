import json
import shutil
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest
from mocapflow_evaluation import compare, comparison_plots
from mocapflow_evaluation.evaluate import Evaluate, evaluate, evaluate_run
from mocapflow_evaluation.references import read_reference
from mocapflow_evaluation.stick import Stick, constant
from mocapflow_evaluation.tracked_motion import TrackedMotion, of_folder, of_track
from mocapflow_export import layout, tables
from mocapflow_export.export import Export
from results_scene import DEMO, demo_scene, stepping
from scipy.signal import lfilter

from mocapflow.errors import RecordingError
from mocapflow.geometry import angles
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.mot import write_mot
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.io.motion.trc import write_trc
from mocapflow.recordings.recording import open_recording
from mocapflow.results import RunFolder

FRAMES = np.arange(120.0)


def row(ours: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    return compare.figures(ours, truth, np.ones(len(ours)), FRAMES[: len(ours)], 30.0)


@pytest.mark.filterwarnings("error")
def test_a_point_that_is_never_seen_hides_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("hip_l", "hip_r", "knee_l", "knee_r", "ear_l")
    places = np.random.default_rng(0).uniform(0, 1, (30, 5, 3))
    places[:, 4] = np.nan
    drawn = []
    monkeypatch.setattr(comparison_plots, "_draw_bones", lambda panel, stick, *_: drawn.append(stick))
    comparison_plots.draw_sticks(
        tmp_path / "a.png", Stick(names=names, places=places), Stick(names=names, places=places), np.arange(30.0)
    )
    assert len(drawn) == 2 * 2 * comparison_plots.MOMENTS
    unseen = np.where(np.arange(5)[:, None] == 3, np.nan, places)
    kept = constant(Stick(names=names, places=unseen)).places
    assert np.isnan(kept[:, 3:]).all() and np.isfinite(kept[:, :3]).all()


def test_identical_curves_deviate_by_nothing() -> None:
    """T-EVAL."""
    curve = 20 * np.sin(FRAMES / 7)
    got = row(curve, curve)
    for name in ("rms_deg", "mae_deg", "offset_deg", "max_deg", "rms_low_deg", "rms_high_deg"):
        assert got[name] == 0
    assert got["correlation"] == pytest.approx(1)
    assert got["lag_frames"] == 0


def test_rms_of_a_known_sinusoid_and_offset() -> None:
    """T-EVAL."""
    truth = np.linspace(0, 50, 120)
    error = 3 * np.sin(2 * np.pi * FRAMES / 40) + 2  # whole periods
    got = row(truth + error, truth)
    assert got["rms_deg"] == pytest.approx(np.sqrt(3**2 / 2 + 2**2))
    assert got["rms_without_offset_deg"] == pytest.approx(3 / np.sqrt(2))
    assert got["offset_deg"] == pytest.approx(2)
    assert got["max_deg"] == pytest.approx(5)
    assert got["worst_frame"] in (10, 50, 90)
    assert got["rms_low_deg"] < got["rms_deg"] < got["rms_high_deg"]


def test_figures_of_errors_from_none_to_a_hundred() -> None:
    got = row(np.arange(101.0), np.zeros(101))
    names = ("mae_deg", "offset_deg", "p95_deg", "max_deg", "worst_frame", "rom_deg", "rom_reference_deg")
    assert [got[name] for name in names] == pytest.approx([50, 50, 95, 100, 100, 100, 0])
    assert row(-np.arange(101.0), np.zeros(101))["worst_frame"] == 100


def test_what_one_frame_and_curves_that_do_not_move_tell() -> None:
    got = row(np.array([3.0]), np.array([1.0]))
    assert got["rms_deg"] == 2 and np.isnan([got["agreement_low_deg"], got["lag_frames"]]).all()
    assert np.isnan(compare.cmc(np.ones((1, 2, 5))))
    assert np.isnan(compare.rms_interval(np.ones(3), 0.2)[0])
    assert compare.rms_interval(np.ones(9), 0.2) == (1, 1)  # a frame in five seconds


@pytest.mark.parametrize("delay", [-3.4, -0.5, 0.0, 0.3, 2.75])
@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_lag_is_recovered_to_a_tenth_of_a_frame(delay: float, noise: float) -> None:
    """T-EVAL."""

    def curve(t: np.ndarray) -> np.ndarray:
        return 30 * np.sin(t / 6) + 10 * np.sin(t / 2.5 + 1)

    wobble = noise * np.random.default_rng(4).normal(size=120)
    assert compare.lag(curve(FRAMES - delay) + wobble + 5, curve(FRAMES), 30.0) == pytest.approx(delay, abs=0.1)


def test_a_gap_in_the_reference_makes_no_lag() -> None:
    """With the rows on both sides of the gap put together, a shift would compare frames that are a gap apart."""
    late, truth = np.sin((FRAMES - 4) / 5), np.sin(FRAMES / 5)
    truth[55:65] = np.nan
    assert row(late, truth)["lag_frames"] == pytest.approx(4, abs=0.01)
    truth[::2] = np.nan  # of half our rate
    assert row(late, truth)["lag_frames"] == pytest.approx(4, abs=0.01)
    late[::5] = np.nan
    assert np.isnan(row(late, truth)["lag_frames"])  # no frame has both at every shift


@pytest.mark.parametrize(
    ("ours", "truth"),
    [(np.ones(60), np.sin(FRAMES[:60])), (np.sin(FRAMES[:60]), np.ones(60)), (FRAMES[:3], FRAMES[:3])],
)
def test_lag_of_a_curve_that_does_not_move_or_is_too_short_is_unknown(ours: np.ndarray, truth: np.ndarray) -> None:
    assert np.isnan(compare.lag(ours, truth, 30.0))


def test_a_lag_needs_a_third_of_what_both_have_at_every_shift() -> None:
    assert compare.lag(np.sin(FRAMES[:10] - 3), np.sin(FRAMES[:10]), 30.0) == pytest.approx(3, abs=0.1)
    ours = np.where(FRAMES % 20 < 16, np.sin((FRAMES - 2) / 5), np.nan)  # of 16 frames 4
    assert np.isnan(compare.lag(ours, np.sin(FRAMES / 5), 30.0))


def test_a_lag_is_looked_for_in_seconds() -> None:
    time = np.arange(240) / 120
    late = np.sin(9 * (time - 0.1))  # 12 frames
    assert compare.lag(late, np.sin(9 * time), 120.0) == pytest.approx(12, abs=0.1)


def hanging_together(seconds: float, rate: float, takes: int) -> np.ndarray:
    """Return errors (takes, T) about 1 of unit spread, whose correlation falls to 1/e within a third of a second."""
    kept = np.exp(-3 / rate)
    noise = np.random.default_rng(0).normal(size=(takes, round(seconds * rate)))
    noise[:, 1:] *= np.sqrt(1 - kept**2)
    return np.asarray(1 + lfilter([1], [1, -kept], noise))


@pytest.mark.parametrize("rate", [10.0, 120.0])
@pytest.mark.long
def test_the_interval_of_an_rms_does_not_hang_on_the_frame_rate(rate: float) -> None:
    low, high = np.transpose([compare.rms_interval(error, rate) for error in hanging_together(16.0, rate, 120)])
    assert 0.72 < np.mean((low <= np.sqrt(2)) & (np.sqrt(2) <= high)) < 0.95


def test_the_interval_of_independent_errors_is_that_of_their_theory() -> None:
    """The RMS of n of them deviates by 1 / sqrt(2 n) of itself, and 95 % lie within 1.96 deviations."""
    errors = np.random.default_rng(0).normal(size=(20, 3000))
    low, high = np.transpose([compare.rms_interval(error, 30.0) for error in errors])
    assert np.mean(high - low) == pytest.approx(2 * 1.96 / np.sqrt(2 * 3000), rel=0.05)


@pytest.mark.parametrize("count", [1, 3])
def test_a_few_frames_tell_no_interval(count: int) -> None:
    assert np.isnan(compare.rms_interval(np.ones(count), 30.0)).all()


def test_coverage_counts_our_own_intervals() -> None:
    truth = np.zeros(120)
    error = np.array([NormalDist().inv_cdf((k + 0.5) / 120) for k in range(120)])
    assert row(error, truth)["coverage_90"] == pytest.approx(0.9)
    assert row(3 * error, truth)["coverage_90"] < 0.6
    unknown = compare.figures(error, truth, np.full(120, np.nan), FRAMES, 30.0)
    assert np.isnan(unknown["coverage_90"])


def columns_only(columns: dict[str, np.ndarray]) -> TrackedMotion:
    """Return our side as it is in a run folder that has nothing but angles."""
    return TrackedMotion(
        columns=columns, raw=columns, stick=Stick(names=(), places=np.empty((len(columns["frame"]), 0, 3)))
    )


@pytest.mark.usefixtures("unrendered")
def test_frames_are_matched_by_number(tmp_path: Path) -> None:
    tables.write_columns(tmp_path / "t.csv", {"frame": np.array([5.0, 7.0]), "knee_flexion_l": np.array([50.0, 70.0])})
    ours = {"frame": np.arange(10.0), "time": np.arange(10) / 30, "knee_flexion_l": 10 * np.arange(10.0) + 1}
    got = evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).rows[0]
    assert (got["frames"], got["rms_deg"], got["offset_deg"]) == (2, 1.0, 1.0)
    errors = read_columns(tmp_path / layout.ERRORS)
    np.testing.assert_array_equal(errors["frame"], ours["frame"])
    np.testing.assert_array_equal(errors["knee_flexion_l"], [1.0 if frame in (5, 7) else np.nan for frame in range(10)])
    assert (tmp_path / layout.EVALUATION).read_text().startswith("angle,frames,rms_deg")


@pytest.mark.usefixtures("unrendered")
def test_our_unsmoothed_curve_is_filtered_as_references_are(tmp_path: Path) -> None:
    """Of two waves that we add, the one of 14 Hz is filtered out; of 4 frames, or 10 a second, nothing can be told."""
    for count, rate, wanted in ((240, 60.0, np.sqrt(3**2 / 2)), (4, 60.0, np.nan), (240, 10.0, np.nan)):
        time = np.arange(count) / rate
        clock, truth = {"frame": np.arange(float(count)), "time": time}, 30 + 20 * np.sin(2 * np.pi * 0.5 * time)
        ours = truth + 3 * np.sin(2 * np.pi * time) + 5 * np.sin(2 * np.pi * 14 * time)
        tables.write_columns(tmp_path / "t.csv", clock | {"knee_flexion_l": truth})
        nothing = Stick(names=(), places=np.empty((count, 0, 3)))
        smoothed, raw = clock | {"knee_flexion_l": truth}, clock | {"knee_flexion_l": ours}
        (got,) = evaluate(TrackedMotion(columns=smoothed, raw=raw, stick=nothing), tmp_path / "t.csv", tmp_path).rows
        assert got["rms_lowpassed_deg"] == pytest.approx(wanted, rel=0.02, nan_ok=True)
        assert got["rms_deg"] < 1e-3
        assert got["rms_unsmoothed_deg"] == pytest.approx(compare.rms(ours - truth), abs=1e-3)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("clock", ["frame", "time"])
def test_a_thigh_that_passes_straight_up_errs_by_the_way_between_and_not_by_a_turn(tmp_path: Path, clock: str) -> None:
    """Raised aside above the level, or in a split: 3 degrees past 179 are -178."""
    frame = np.arange(60.0)
    at = frame if clock == "frame" else np.arange(0, 60, 0.75)
    hip, theirs = (180 + 25 * np.sin(2 * np.pi * each / 40) for each in (frame, at))
    ours = {"frame": frame, "time": frame / 30, "hip_flexion_l": (hip + 3) % 360, "knee_flexion_l": 0.5 * hip}
    ours["hip_flexion_l"][ours["hip_flexion_l"] > 180] -= 360
    curves = {"hip_flexion_l": theirs - 360 * (theirs > 180), "knee_flexion_l": -0.5 * theirs}
    tables.write_columns(tmp_path / "t.csv", {clock: at if clock == "frame" else at / 30, **curves})
    evaluation = evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path)
    got = {str(row["angle"]): row for row in evaluation.rows}
    for name in ("rms_deg", "rms_unsmoothed_deg", "max_deg", "mae_deg"):
        assert got["hip_flexion_l"][name] == pytest.approx(3, abs=0.3), name
    assert got["hip_flexion_l"]["rms_lowpassed_deg"] == pytest.approx(3, abs=1)
    assert got["hip_flexion_l"]["rms_aligned_deg"] == pytest.approx(0, abs=0.2)
    assert got["knee_flexion_l"]["max_deg"] == pytest.approx(205, abs=0.5)  # counted the other way: no turn between
    errors = read_columns(tmp_path / layout.ERRORS)["hip_flexion_l"]
    assert np.nanmax(np.abs(errors - 3)) < 0.5


@pytest.mark.usefixtures("unrendered")
def test_the_share_of_frames_in_doubt_is_told_by_a_track_and_by_its_files(tmp_path: Path) -> None:
    scene = demo_scene()
    track = stepping(scene.body)
    count = len(track.frame)
    number = np.arange(count)
    doubtful = replace(
        track,
        steady=number % 2 == 1, doubted=number < 3, iterations=np.where(number == 5, 0, track.iterations).astype("i2"),
    )  # fmt: skip
    wanted = len({*range(0, count, 2), 1, 5}) / count
    own = of_track(doubtful, scene)
    assert own.flagged_share == wanted
    Export().run(track=doubtful, scene=scene, recording=open_recording(DEMO), run_folder=run_folder(tmp_path))
    assert of_folder(tmp_path).flagged_share == wanted
    evaluate_run(tmp_path, DEMO / "truth" / "angles.csv")
    assert json.loads((tmp_path / layout.FINDINGS).read_text())["flagged_share"] == wanted
    (tmp_path / layout.RUN).write_text("{}")
    assert np.isnan(of_folder(tmp_path).flagged_share)
    (tmp_path / layout.RUN).unlink()
    assert np.isnan(of_folder(tmp_path).flagged_share)


@pytest.mark.usefixtures("unrendered")
def test_columns_that_are_no_angles_of_ours_are_named(tmp_path: Path) -> None:
    ours = {"frame": np.arange(10.0), "time": np.arange(10) / 30, "knee_flexion_l": 10 * np.arange(10.0)}
    for count, more in ((10, ""), (12, " and 2 more")):
        strange = {f"Knee_{number}": np.zeros(10) for number in range(count)}
        tables.write_columns(tmp_path / "t.csv", {**ours, **strange, "knee_flexion_l_sd": np.ones(10)})
        notes = evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).notes
        assert f"not compared, for the track has no such angles: {', '.join(list(strange)[:10])}{more}" in notes


@pytest.mark.usefixtures("unrendered")
def test_nothing_is_said_of_a_reference_that_agrees(tmp_path: Path) -> None:
    curves = {"knee_flexion_l": 40 + 20 * np.sin(FRAMES / 5), "knee_flexion_r": 1e-3 * np.sin(FRAMES / 5)}
    ours = {"frame": FRAMES, "time": FRAMES / 30, **curves}
    tables.write_columns(tmp_path / "t.csv", ours)
    assert evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).notes == ()


def run_folder(path: Path) -> RunFolder:
    return RunFolder(path=path, recipe={})


def test_without_reference_there_is_a_note_and_no_error(tmp_path: Path) -> None:
    scene = demo_scene()
    recording = SimpleNamespace(folder=tmp_path)
    former = layout.place(tmp_path, layout.ERRORS)
    former.write_text("of another reference")
    Evaluate().need(recording)
    got = Evaluate().run(track=stepping(scene.body), scene=scene, recording=recording, run_folder=run_folder(tmp_path))
    assert (got.rows, got.reference) == ((), "")
    assert "truth/angles.csv" in got.notes[0]
    assert not former.exists()


@pytest.mark.long
def test_demo_truth_is_found(tmp_path: Path) -> None:
    scene = demo_scene()
    recording = SimpleNamespace(folder=DEMO)
    track = stepping(scene.body)
    got = Evaluate().run(track=track, scene=scene, recording=recording, run_folder=run_folder(tmp_path))
    assert [r["angle"] for r in got.rows] == [d.name for d in angles.definitions(scene.body.joint_names)]
    assert all(r["frames"] == len(track.frame) for r in got.rows)


@pytest.mark.usefixtures("unrendered")
def test_a_run_folder_is_evaluated_from_its_files(tmp_path: Path) -> None:
    truth = DEMO / "truth" / "angles.csv"
    columns = read_columns(truth)
    ours = {"frame": columns["frame"], "time": columns["frame"] / 30}
    ours |= {n: v + 1.5 for n, v in columns.items() if n != "frame"}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), ours)
    got = evaluate_run(tmp_path, truth)
    assert len(got.rows) == 8
    assert all(r["rms_deg"] == pytest.approx(1.5, abs=1e-3) for r in got.rows)


def test_a_comparison_stays_where_another_has_nothing_to_compare(tmp_path: Path) -> None:
    ours = {"frame": np.arange(3.0), "time": np.arange(3.0) / 30, "knee_flexion_l": np.arange(3.0)}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), ours)
    truth, elsewhere = tmp_path / "truth.csv", tmp_path / "elsewhere.csv"
    tables.write_columns(truth, ours)
    tables.write_columns(elsewhere, {**ours, "frame": ours["frame"] + 100})
    evaluate_run(tmp_path, truth)
    before = {path: path.read_bytes() for path in (tmp_path / layout.RESULTS).iterdir()}
    assert not evaluate_run(tmp_path, elsewhere).rows
    assert {path: path.read_bytes() for path in (tmp_path / layout.RESULTS).iterdir()} == before


@pytest.mark.usefixtures("unrendered")
def test_a_comparison_forgets_what_another_reference_left_but_the_keypoints(tmp_path: Path) -> None:
    ours = {"frame": np.arange(3.0), "time": np.arange(3.0) / 30, "knee_flexion_l": np.arange(3.0)}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), ours)
    tables.write_columns(tmp_path / "truth.csv", ours)
    for part in (layout.STICK, layout.CYCLES, layout.KEYPOINTS):
        (tmp_path / part).write_text("of another")
    got = evaluate_run(tmp_path, tmp_path / "truth.csv")
    assert got.rows and got.notes == ("no lag within 0.5 s fits best; see longest_lag_s of stage evaluate",)
    assert [(tmp_path / part).exists() for part in (layout.STICK, layout.CYCLES, layout.KEYPOINTS)] == [
        False,
        False,
        True,
    ]


@pytest.mark.usefixtures("unrendered")
def test_small_angles_in_radians_beside_a_column_of_something_else_are_told(tmp_path: Path) -> None:
    ours = {"frame": np.arange(60.0), "time": np.arange(60) / 30, "knee_flexion_l": 7 + 5 * np.sin(np.arange(60) / 5)}
    for unit, told in ((1.0, False), (np.pi / 180, True)):
        theirs = {**ours, "knee_flexion_l": unit * ours["knee_flexion_l"], "phase": np.linspace(0, 100, 60)}
        tables.write_columns(tmp_path / "t.csv", theirs)
        notes = evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).notes
        assert ("no angle of the reference is above 0.2, ours reach 12: is it in radians?" in notes) == told
        assert any("radians" in note for note in notes) == told


@pytest.mark.usefixtures("unrendered")
def test_a_reference_with_frame_numbers_of_another_rate_is_told(tmp_path: Path) -> None:
    ours = {"frame": np.arange(60.0), "time": np.arange(60) / 30, "knee_flexion_l": np.sin(np.arange(60) / 5)}
    many = np.arange(240.0)
    theirs = {"frame": many, "time": many / 120, "knee_flexion_l": np.sin(many / 20)}
    tables.write_columns(tmp_path / "t.csv", theirs)
    (told,) = [n for n in evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).notes if "by number" in n]
    assert "the reference has 120 frames per second, ours 30: without its column frame it is matched by time" in told
    tables.write_columns(tmp_path / "t.csv", {name: column for name, column in theirs.items() if name != "frame"})
    assert evaluate(columns_only(ours), tmp_path / "t.csv", tmp_path).rows[0]["rms_deg"] < 1e-4


@pytest.mark.long
def test_a_reference_in_radians_or_out_of_order_is_told(tmp_path: Path) -> None:
    columns = read_columns(DEMO / "truth" / "angles.csv")
    clock = {"frame": columns.pop("frame")}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), clock | {"time": clock["frame"] / 30} | columns)
    turned = tables.write_columns(tmp_path / "turned.csv", clock | {n: np.radians(v) for n, v in columns.items()})
    assert any(note.endswith("is it in radians?") for note in evaluate_run(tmp_path, turned).notes)
    assert not any("radians" in note for note in evaluate_run(tmp_path, DEMO / "truth" / "angles.csv").notes)
    tables.write_columns(turned, clock | columns | {"knee_flexion_l": -10 * columns["knee_flexion_l"]})
    with pytest.raises(RecordingError, match=r"turned\.csv  knee_flexion_l reaches \d+°, more than once around\n"):
        evaluate_run(tmp_path, turned)
    clock["frame"][5] = 4
    tables.write_columns(turned, clock | columns)
    with pytest.raises(RecordingError, match=r"turned\.csv  the frame does not grow from row 5 to row 6\n"):
        evaluate_run(tmp_path, turned)


def test_times_in_milliseconds_are_an_error_not_samples_far_apart(tmp_path: Path) -> None:
    write_mot(tmp_path / "ms.mot", {"knee_angle_r": np.linspace(0, 60, 30)}, np.arange(30) * 33.3)
    tables.write_columns(tmp_path / "ms.csv", {"time": np.array([0, 33.3]), "knee_flexion_r": np.array([0.0, 60])})
    for name in ("ms.mot", "ms.csv"):
        with pytest.raises(RecordingError, match=r"samples are 33\.3 s apart(.|\n)*are these milliseconds"):
            read_reference(tmp_path / name)


def test_folder_without_angles_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"results/angles\.csv  there are no angles to compare\n .*`mocapflow run`"
    ):
        evaluate_run(tmp_path, DEMO / "truth" / "angles.csv")


@pytest.mark.usefixtures("unrendered")
def test_motion_file_in_time_is_interpolated(tmp_path: Path) -> None:
    time = np.arange(0, 2, 0.01)
    columns = {"knee_angle_r": 30 + 20 * np.sin(5 * time), "pelvis_ty": np.ones_like(time)}
    write_mot(tmp_path / "m.mot", columns, time)
    frames = np.arange(80.0)
    ours = {"frame": frames, "time": frames / 30, "knee_flexion_r": 30 + 20 * np.sin(5 * frames / 30)}
    got = evaluate(columns_only(ours), tmp_path / "m.mot", tmp_path).rows
    assert [r["angle"] for r in got] == ["knee_flexion_r"]
    assert got[0]["rms_deg"] < 0.01
    assert got[0]["frames"] == np.sum(frames / 30 <= 1.99)


@pytest.mark.usefixtures("unrendered")
def test_times_that_count_from_one_sample_start_at_zero(tmp_path: Path) -> None:
    time = np.arange(1, 51) / 60
    curve = 30 + 20 * np.sin(np.arange(50) / 5)
    write_mot(tmp_path / "m.mot", {"knee_angle_r": curve}, time)
    ours = {"frame": np.arange(50.0), "time": np.arange(50) / 60, "knee_flexion_r": curve}
    got = evaluate(columns_only(ours), tmp_path / "m.mot", tmp_path).rows[0]
    assert (got["frames"], round(float(got["rms_deg"]), 3)) == (50, 0)


@pytest.mark.usefixtures("unrendered")
def test_gait2392_counts_knees_the_other_way_which_is_told_and_not_changed(tmp_path: Path) -> None:
    time = np.arange(50) / 30
    curve = 40 + 20 * np.sin(5 * time)
    write_mot(tmp_path / "m.mot", {"knee_angle_l": 3 - curve}, time)
    ours = {"frame": np.arange(50.0), "time": time, "knee_flexion_l": curve}
    got = evaluate(columns_only(ours), tmp_path / "m.mot", tmp_path)
    (row,) = got.rows
    assert row["sign"] == -1
    assert float(row["rms_deg"]) > 80
    assert row["rms_aligned_deg"] == pytest.approx(0, abs=1e-3)
    assert any("counts the other way: knee_flexion_l" in note for note in got.notes)


@pytest.mark.parametrize("style", ["ours", "Pose2Sim"])
def test_joint_centres_give_three_point_angles(tmp_path: Path, style: str) -> None:
    found = np.load(DEMO / "truth" / "joints.npz")
    names, places = [str(n) for n in found["names"]], found["positions"].astype(np.float64)
    theirs = {"hip_l": "LHip", "knee_l": "LKnee", "ankle_l": "LAnkle"}
    shown = names if style == "ours" else [theirs.get(n, n) for n in names]
    write_trc(tmp_path / "j.trc", shown, opensim_from_world(places), 30.0)
    truth = read_columns(DEMO / "truth" / "angles.csv")
    assert np.abs(read_reference(tmp_path / "j.trc").curves["knee_flexion_l"] - truth["knee_flexion_l"]).max() < 0.01


def test_unreadable_references_say_so(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="keypoints  no such reference"):  # a folder that is not there
        read_reference(tmp_path / "keypoints")
    (tmp_path / "a.xlsx").touch()
    with pytest.raises(RecordingError, match=r"can't compare with a \.xlsx"):
        read_reference(tmp_path / "a.xlsx")
    (tmp_path / "a").touch()
    with pytest.raises(RecordingError, match="can't compare with a file without ending"):
        read_reference(tmp_path / "a")
    (tmp_path / "a.csv").write_text("frame,knee_flexion_l\n0,1\n1,x\n")
    with pytest.raises(RecordingError, match=r"a\.csv:3"):
        read_reference(tmp_path / "a.csv")
    (tmp_path / "b.CSV").write_text("knee_flexion_l\n0\n1\n")
    with pytest.raises(RecordingError, match="neither a column frame nor time"):
        read_reference(tmp_path / "b.CSV")


def test_a_reference_that_can_not_be_read_is_told_before_anything_runs(tmp_path: Path) -> None:
    recording = tmp_path / "clip"
    shutil.copytree(DEMO, recording, ignore=shutil.ignore_patterns("background"))
    Evaluate().need(open_recording(recording))
    (recording / "truth" / "angles.csv").write_text("frame,knee_flexion_l\n0,a\n")
    with pytest.raises(RecordingError, match=r"angles.csv:2:\d+  '.*' is no number"):
        Evaluate().need(open_recording(recording))
