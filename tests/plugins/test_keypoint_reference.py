"""2D keypoints as a reference: exact where the cameras are right, wrong where one has turned; the filter."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from keypoint_recording import DEMO, copy_demo, write
from mocapflow_bodies.template import Template
from mocapflow_evaluation.evaluate import Evaluate
from mocapflow_evaluation.keypoint_reference import low_pass
from mocapflow_export import layout
from mocapflow_fitting.align_cameras import turn
from mocapflow_fitting.landmarks import landmarks
from results_scene import make_track, stepping

from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.io.motion.opensim_axes import world_from_opensim
from mocapflow.io.motion.trc import read_trc
from mocapflow.knocks import Knocks
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.results import Evaluation, RunFolder, Track, ViewChecks
from mocapflow.scene import Scene

FRAMES = 16  # a little more than the filter needs
BODY = Template(height_m=1.72).load(DEMO)


@pytest.fixture(scope="module")
def track() -> Track:
    swing = stepping(BODY, 192)  # so slow that the filter leaves it
    return make_track(swing.root[:FRAMES], swing.angles[:FRAMES])


@pytest.fixture(scope="module")
def recording(track: Track, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return a recording whose second camera has turned by a degree since it was calibrated, beside a bystander."""
    folder = copy_demo(tmp_path_factory.mktemp("turned") / "recording")
    cameras = seen_by(open_recording(folder))
    write(folder, BODY, [track.pose(t) for t in range(FRAMES)], cameras, noise_px=0.0)
    return open_recording(folder, start=2, stop=FRAMES, step=3)


def seen_by(recording: Recording):
    turns = np.zeros((4, 3))
    turns[1] = np.radians([0.3, 0.9, 0.2])
    return turn(recording.cameras, turns)


def evaluated(track: Track, recording: Recording, cameras, out: Path, checks: ViewChecks | None = None) -> Evaluation:
    scene, folder = Scene(cameras=cameras, body=BODY), RunFolder(path=out, recipe={})
    return Evaluate(reference="keypoints").run(track, scene, recording, folder, checks)


def apart(evaluation: Evaluation, track: Track) -> float:
    """Return how far (m) the reference is at most from where the estimator's marks truly were."""
    names, places, time, _ = read_trc(Path(evaluation.reference))
    np.testing.assert_allclose(time[:FRAMES], track.time, atol=1e-6)
    marks = landmarks(BODY)
    poses = [track.pose(t) for t in range(FRAMES)]
    known = np.stack([kinematics.skin(marks.body, kinematics.chain(marks.body, p)[0], p.angles) for p in poses])
    columns = [names.index(name.replace("big_toe", "toe")) for name in marks.names]
    return float(np.abs(world_from_opensim(places)[:FRAMES, columns] - known).max())


def test_a_folder_without_keypoints_of_two_cameras_is_told_before_the_run(recording: Recording, tmp_path: Path) -> None:
    (tmp_path / "cam01_json").mkdir()
    with pytest.raises(RecordingError, match="no 2D keypoints of two cameras") as told:
        Evaluate(reference=str(tmp_path)).need(recording)
    assert told.value.where == str(tmp_path)
    Evaluate(reference="keypoints").need(recording)


@pytest.mark.long
def test_right_cameras_give_the_very_points(track: Track, recording: Recording, tmp_path: Path) -> None:
    evaluation = evaluated(track, recording, seen_by(recording), tmp_path)
    assert apart(evaluation, track) < 1e-4
    rows = {row["angle"]: row for row in evaluation.rows}
    for side in "lr":  # its hips are marked outside their centres, which is an offset
        assert rows[f"knee_flexion_{side}"]["frames"] == FRAMES
        assert rows[f"knee_flexion_{side}"]["rms_without_offset_deg"] < 1.0


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_joint_centres_are_compared_where_they_are(track: Track, recording: Recording, tmp_path: Path) -> None:
    """Both are in the world of the cameras: a person who was tracked 5 cm aside is not moved back."""
    aside = track.root.copy()
    aside[:, 0, 3] += 0.05
    evaluation = evaluated(make_track(aside, track.angles), recording, seen_by(recording), tmp_path)
    with (tmp_path / layout.DISTANCES).open(newline="") as file:
        rows = {row["joint"]: row for row in csv.DictReader(file)}
    for joint in ("neck", "knee_l", "wrist_r"):  # are marked at their centres
        assert float(rows[joint]["mean_mm"]) == pytest.approx(50, abs=0.1)
    assert not any("registered" in note for note in evaluation.notes)


@pytest.mark.long
@pytest.mark.usefixtures("unrendered")
def test_a_turned_camera_gives_others(track: Track, recording: Recording, tmp_path: Path) -> None:
    assert apart(evaluated(track, recording, recording.cameras, tmp_path), track) > 0.005


@pytest.mark.long
@pytest.mark.usefixtures("unrendered")
def test_keypoints_of_a_knocked_camera_are_moved_back(track: Track, recording: Recording, tmp_path: Path) -> None:
    before, since = recording.cameras[1], seen_by(recording)[1]
    turned = since.camera_from_world[:3, :3] @ before.camera_from_world[:3, :3].T
    way = since.intrinsics @ turned @ np.linalg.inv(before.intrinsics)
    knocks = Knocks(frame=np.zeros(1, np.int32), camera=np.ones(1, np.int16), turn=way[None])
    checks = ViewChecks(frame=np.empty(0, np.int32), camera=np.empty(0, np.int16), reasons=(), knocks=knocks)
    assert apart(evaluated(track, recording, recording.cameras, tmp_path, checks), track) < 1e-4


@pytest.mark.usefixtures("undrawn")
@pytest.mark.long
def test_a_point_that_one_camera_mistakes_is_where_the_others_see_it(
    track: Track, recording: Recording, tmp_path: Path
) -> None:
    cameras = seen_by(recording)
    wrong = turn([cameras[3]], np.radians([[0.0, 20.0, 0.0]]))
    assert apart(evaluated(track, recording, (*cameras[:3], *wrong), tmp_path), track) < 1e-3


def test_the_filter_keeps_what_is_slow_and_has_no_lag() -> None:
    time = np.arange(240) / 60.0
    slow, fast = np.sin(2 * np.pi * time), np.sin(2 * np.pi * 20 * time)
    middle = slice(40, 200)
    np.testing.assert_allclose(low_pass(slow + fast, 60.0)[middle], slow[middle], atol=0.015)


@pytest.mark.parametrize("frequency", [6.0, 12.0])
def test_the_filter_halves_its_own_frequency_and_falls_with_the_fourth_power(frequency: float) -> None:
    """Each pass is of second order: a gain of 1 / sqrt(1 + r^4), and frequencies are warped as the tangent has it."""
    time = np.arange(600) / 60.0
    wave = np.sin(2 * np.pi * frequency * time)
    ratio = np.tan(np.pi * frequency / 60) / np.tan(np.pi * 6 / 60)
    middle = slice(100, 500)
    np.testing.assert_allclose(low_pass(wave, 60.0)[middle], wave[middle] / (1 + ratio**4), atol=0.001)


def test_gaps_stay_and_short_stretches_too() -> None:
    values = np.linspace(0.0, 1.0, 60)[:, None] * [1.0, 2.0, 0.0]
    values[30:33, 1:], values[42:, 1] = np.nan, np.nan
    values[33:, 2] = 5.0
    passed = low_pass(values, 60.0)
    np.testing.assert_allclose(passed[:, 0], values[:, 0], atol=1e-3)  # a line is as slow as can be
    np.testing.assert_array_equal(np.isnan(passed), np.isnan(values))
    np.testing.assert_array_equal(passed[33:42, 1], values[33:42, 1])  # the filter reaches over 9 frames
    np.testing.assert_allclose(passed[:, 2], values[:, 2], atol=1e-9)  # nothing flows across a gap


@pytest.mark.parametrize("rate", [10.0, 12.0])
def test_too_few_frames_a_second_for_a_filter(rate: float) -> None:
    values = np.random.default_rng(1).normal(size=(40, 3))
    np.testing.assert_array_equal(low_pass(values, rate), values)
