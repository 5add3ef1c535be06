"""Cameras that are late against the others: measured, written down, heeded."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import centre, project
from mocapflow.geometry.epipolar import pencil_axes, plane_angles
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.io.video.lateness import late_frames, write_late_frames
from mocapflow.recordings import doctor, paired_views, synchrony
from mocapflow.recordings.doctor import examine_timing
from mocapflow.recordings.recording import open_recording
from tests.fixtures.recordings import look_at

PLACES = [(3, 0.5, 1.4), (0.3, 3, 1.0), (-2, -2, 1.8)]
SIZE, FRAMES, RADIUS = (160, 120), 60, 0.3
NAMES = ("cam01", "cam02", "cam03")


def cameras():
    return [look_at(n, np.array(p), SIZE, focal=150.0) for n, p in zip(NAMES, PLACES, strict=True)]


def ball(moment):
    t = np.asarray(moment, float) / 8
    return np.stack([0.3 * np.sin(t), 0.25 * np.cos(1.3 * t), 1 + 0.2 * np.sin(0.7 * t)], axis=-1)


def picture(camera, moment):
    image = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
    there = ball(moment)[None]
    x, y = project(there, camera)[0]
    away = (camera.camera_from_world @ np.append(there, 1))[2]
    cv2.circle(
        image, (round(16 * x), round(16 * y)), round(16 * 150 * RADIUS / away), (200, 220, 240), -1, cv2.LINE_AA, 4
    )
    return image


def write(folder, late):
    """A ball seen by three cameras; pictures of each come so many frames after the moment they should show."""
    (folder / "background").mkdir(parents=True)
    write_cameras(folder / "cameras.toml", cameras())
    for camera in cameras():
        place = folder / "videos" / camera.name
        place.mkdir(parents=True)
        cv2.imwrite(str(folder / "background" / f"{camera.name}.png"), np.full((SIZE[1], SIZE[0], 3), 60, np.uint8))
        for index in range(FRAMES):
            cv2.imwrite(str(place / f"{index:06}.png"), picture(camera, index - late.get(camera.name, 0)))
    return folder


def test_two_cameras_see_a_point_in_the_same_plane():
    points = ball(np.arange(60))
    one, other, _ = cameras()
    axes = pencil_axes(one, other)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)
    angles = [plane_angles(project(points, camera), camera, axes) for camera in (one, other)]
    np.testing.assert_allclose(angles[0], angles[1], atol=1e-9)
    assert np.ptp(angles[0]) > 0.1
    looked_at = np.array([[0.0, 0.0, 1.0]])  # there the angle is zero
    assert [plane_angles(project(looked_at, camera), camera, axes)[0] for camera in (one, other)] == pytest.approx(
        [0, 0]
    )


def test_cameras_that_face_each_other_agree_on_a_plane_too():
    one, other = (look_at(name, np.array([x, 0.0, 1.0]), SIZE, focal=150.0) for name, x in (("a", 3.0), ("b", -2.0)))
    axes = pencil_axes(one, other)
    np.testing.assert_allclose(axes @ np.column_stack([axes.T, [1.0, 0, 0]]), np.eye(2, 3), atol=1e-12)
    points = ball(np.arange(10))
    angles = [plane_angles(project(points, camera), camera, axes) for camera in (one, other)]
    np.testing.assert_allclose(angles[0], angles[1], atol=1e-9)


@pytest.mark.parametrize("lag", [0, 3, -2.4])
def test_a_lag_between_signals_is_found_between_frames(lag):
    moments, rng = np.arange(80)[:, None], np.random.default_rng(0)
    one = np.sin(moments / [7, 11]) + 0.02 * rng.normal(size=(80, 2))
    other = np.sin((moments - lag) / [7, 11]) + 0.3 + 0.02 * rng.normal(size=(80, 2))  # and a bias
    other[10:20, 0] = np.nan
    found, information = synchrony.best_lag(one, other, 10)
    assert found == pytest.approx(lag, abs=0.2)
    assert information > 1
    assert synchrony.best_lag(np.ones((80, 1)), np.ones((80, 1)), 10)[1] == 0  # nothing moves


def test_a_lag_is_unknown_where_too_little_is_seen_of_it_by_both():
    signal = np.sin(np.arange(76)[:, None] / [7, 11]) + 0.02 * np.random.default_rng(0).normal(size=(76, 2))
    one, other = signal.copy(), signal.copy()
    one[40:], other[:36] = np.nan, np.nan  # 4 frames of the same moments; as if 10 late 14
    assert synchrony.best_lag(one, other, 10) == (0, 0)
    assert synchrony.best_lag(one, np.full_like(other, np.nan), 10) == (0, 0)


@pytest.mark.parametrize(("late", "frames"), [([0, 3], [0, 3]), ([3, 0], [3, 0]), ([0, 0, 3, 3], [0, 0, 3, 3])])
def test_of_two_halves_the_earlier_one_is_punctual(late, frames):
    moments, random = np.arange(80)[:, None], np.random.default_rng(0)
    seen = [np.sin((moments - by) / [7, 11]) + 0.01 * random.normal(size=(80, 2)) for by in late]
    found = synchrony.lateness([str(k) for k in range(len(late))], lambda a, b: (seen[a], seen[b]), 10)
    assert [each.frames for each in found] == pytest.approx(frames, abs=0.1)


def test_signals_without_noise_are_surely_not_late_and_leave_the_others_as_they_are():
    signal = np.sin(np.arange(80)[:, None] / [7, 11])
    noisy = signal + 0.02 * np.random.default_rng(0).normal(size=signal.shape)
    seen = [signal, signal, noisy]
    found = synchrony.lateness(NAMES, lambda one, other: (seen[one], seen[other]), 10)
    assert [each.frames for each in found] == pytest.approx([0, 0, 0], abs=0.1)
    assert 0 < found[0].sd < found[2].sd < 0.1


def test_one_wild_error_does_not_move_the_lag():
    moments = np.arange(80)[:, None]
    one, other = np.sin(moments / [7, 11]), np.sin(moments / [7, 11]) + 0.01 * np.cos(moments)
    one[-1] += 3.0  # that a lag of a frame would leave out
    assert synchrony.best_lag(one, other, 10)[0] == pytest.approx(0, abs=0.1)


def test_a_constant_difference_is_the_calibration_s_in_every_signal_by_itself():
    nan = np.nan
    one = np.array([[0.0, 0.0, nan], [1.0, 0.2, nan], [4.0, nan, nan]])
    other = np.array([[1.0, 0.5, nan], [1.5, 0.5, nan], [1.0, 0.5, nan]])
    centred = synchrony._centred(one, other)  # their medians are -0.5 and -0.4
    np.testing.assert_allclose(centred, [[-0.5, -0.1, nan], [0.0, 0.1, nan], [3.5, nan, nan]])


def test_an_outline_around_the_other_camera_touches_no_plane():
    one, other, _ = cameras()
    to_other = project(centre(other)[None], one)[0]
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = 5 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    wide = replace(one, size=np.array([10_000, 10_000], np.int32))  # so that no outline is cut at the border
    assert np.all((to_other > 20) & (to_other < 9_000))
    found = paired_views._touching(
        [to_other + ring, to_other + ring + 8, np.empty((0, 2))], wide, pencil_axes(one, other)
    )
    assert np.isnan(found).tolist() == [[True, True], [False, False], [True, True]]


@pytest.mark.long
def test_a_late_camera_is_measured_and_heeded(tmp_path):
    folder = write(tmp_path / "clip", {"cam02": 3})
    measured = {m.camera: m for m in synchrony.measure(open_recording(folder))}
    assert measured["cam02"].frames == pytest.approx(3, abs=0.3)
    assert [measured[name].sure for name in NAMES] == [False, True, False]
    told = examine_timing(folder)
    assert "cam02 is 3.0 frames late" in told[-1].message
    assert told[-1].hint.startswith('write {"late_frames": {"cam02": 3.0')
    examine_timing(folder, write=True)
    written = json.loads((folder / "recording.json").read_text())["late_frames"]
    assert written == {"cam02": pytest.approx(measured["cam02"].frames, abs=0.005)}
    assert not any(m.sure for m in synchrony.measure(open_recording(folder)))
    recording = open_recording(folder)
    assert "recording.json" in recording.content
    first, last = recording.frame(0), recording.frame(FRAMES - 1)
    assert (first.images[1] == picture(cameras()[1], 0)).all()
    assert last.usable.tolist() == [True, False, True]
    assert last.reasons[1] == "there is no image of this frame"


def test_keypoints_tell_too(tmp_path):
    folder = write(tmp_path / "clip", {})
    for camera in cameras():
        place = folder / "keypoints" / f"{camera.name}_json"
        place.mkdir(parents=True)
        for index in range(FRAMES):
            moments = index - 3 * (camera.name == "cam03") + np.array([0, 40, 90])
            rows = np.column_stack([project(ball(moments), camera), np.ones(3)])
            people = {"people": [{"pose_keypoints_2d": rows.ravel().tolist()}]}
            (place / f"{index:06}.json").write_text(json.dumps(people))
    signals = paired_views.keypoint_signals(open_recording(folder))
    assert signals(0, 1)[0].shape == (FRAMES, 3)
    late = {m.camera: m.frames for m in synchrony.measure(open_recording(folder))}
    assert late == pytest.approx({"cam01": 0, "cam02": 0, "cam03": 3}, abs=0.1)
    part = {m.camera: m.frames for m in synchrony.measure(open_recording(folder, stop=14))}  # less than half a second
    assert part == pytest.approx(late, abs=0.1)


def test_outlines_tell_where_keypoints_are_sparse(tmp_path):
    folder = write(tmp_path / "clip", {"cam02": 3})
    for name in NAMES:
        place = folder / "keypoints" / f"{name}_json"
        place.mkdir(parents=True)
        (place / "000000.json").write_text(json.dumps({"people": [{"pose_keypoints_2d": [80.0, 60.0, 1.0]}]}))
    measured = {m.camera: m.frames for m in synchrony.measure(open_recording(folder))}
    assert measured["cam02"] == pytest.approx(3, abs=0.3)


@pytest.mark.parametrize(
    ("before", "found", "after"),
    [
        ({"cam01": 3}, [0, 4, 0], {"cam01": 3, "cam02": 4}),
        ({"cam01": 3, "cam03": 4}, [0, 4, 0], {"cam02": 1, "cam03": 1}),  # not every camera can be late
        ({"cam01": -3, "cam03": -4}, [0, -4, 0], {"cam02": -1, "cam03": -1}),
        ({"cam01": 3}, [0.8, 4, 0], {"cam01": 3, "cam02": 4}),  # the first is not sure
    ],
)
def test_what_is_found_comes_on_top_of_what_is_known(tmp_path, monkeypatch, before, found, after):
    folder = write(tmp_path / "clip", {})
    (folder / "recording.json").write_text(json.dumps({"late_frames": before}))
    measured = [
        synchrony.Lateness(camera=name, frames=frames, sd=0.5) for name, frames in zip(NAMES, found, strict=True)
    ]
    monkeypatch.setattr(doctor, "_measured", lambda folder: measured)
    assert examine_timing(folder)[-1].message == f"cam02 is 4.0 frames {'late' if found[1] > 0 else 'early'}"
    assert examine_timing(folder, write=True)[-1].message.startswith("written")
    assert json.loads((folder / "recording.json").read_text())["late_frames"] == after
    open_recording(folder)  # and every run takes it


def test_frames_are_late_by_whole_ones_and_written_to_a_hundredth(tmp_path):
    write_late_frames(tmp_path, {"cam01": 2.837, "cam02": -3.46, "cam03": 0.44})
    said = json.loads((tmp_path / "recording.json").read_text())
    assert said == {"late_frames": {"cam01": 2.84, "cam02": -3.46, "cam03": 0.44}}
    assert late_frames(tmp_path, [*NAMES, "cam04"]) == (3, -3, 0, 0)
    with pytest.raises(RecordingError, match=r"nowhere/recording\.json  can't be written"):
        write_late_frames(tmp_path / "nowhere", {"cam01": 3})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "recording.json:1:2  not JSON: "),
        ("{}", "does not say how late the cameras are: KeyError"),
        ('{"late": {}}', "recording.json:1:3  unknown setting 'late'"),
        ('{"late_frames": {"cam01": "much"}}', "does not say how late the cameras are: ValueError"),
        ('{"late_frames": {"cam01": 1e999}}', "does not say how late the cameras are: OverflowError"),
        ('{"late_frames": {"cam01": true}}', "does not say how late the cameras are: TypeError"),
        ('{"late_frames": {"cam1": 3}}', "there is no camera 'cam1'"),
        ('{"late_frames": {}, "late_frame": {"cam01": 3}}', "unknown setting 'late_frame'"),
        (
            '{"late_frames": {"cam01": 4, "cam02": 5, "cam03": 6}}',
            "every camera is said to be late.*\n *cameras.* 4 off",
        ),
        ('{"late_frames": {"cam01": -4, "cam02": -5, "cam03": -2}}', "or every one early\n.*take -2 off each"),
    ],
)
def test_a_wrong_recording_json_is_explained(tmp_path, text, said):
    folder = write(tmp_path / "clip", {})
    (folder / "recording.json").write_text(text)
    with pytest.raises(RecordingError, match=said):
        open_recording(folder)


@pytest.mark.long
def test_the_standard_deviation_of_a_lag_is_that_of_repeated_noise():
    random, t = np.random.default_rng(0), np.arange(200)
    true = np.stack([np.sin(t / 9), np.cos(t / 13)], axis=1)
    lags, told = [], []
    for _ in range(200):
        noise = np.repeat(0.1 * random.normal(size=(2, 40, 2)), synchrony.ALIKE, axis=1)  # alike for so many frames
        lag, information = synchrony.best_lag(true + noise[0], true + noise[1], 10)
        lags.append(lag)
        told.append(information)
    stated = np.mean(told) ** -0.5
    assert abs(np.mean(lags)) < 4 * stated / np.sqrt(len(lags))
    assert 0.6 < np.std(lags) / stated < 1.6


@pytest.mark.parametrize(
    ("frames", "sd", "sure"), [(0.6, 0.1, True), (0.4, 0.01, False), (-2.0, 0.6, True), (-2.0, 0.7, False)]
)
def test_a_camera_is_late_beyond_half_a_frame_and_three_standard_deviations(frames, sd, sure):
    assert synchrony.Lateness(camera="cam01", frames=frames, sd=sd).sure == sure


def test_a_camera_that_shares_nothing_with_the_others_is_not_called_punctual():
    moving = np.sin(np.arange(60.0) / 5)[:, None]

    def signals(one, other):
        noisy = moving + np.random.default_rng(other).normal(0, 0.01, moving.shape)
        return moving, noisy if other < 3 else np.full_like(moving, np.nan)

    assert len(synchrony.lateness(["a", "b", "c"], signals, 5)) == 3
    with pytest.raises(RecordingError, match="too little of the same person"):
        synchrony.lateness(["a", "b", "c", "d"], signals, 5)
    with pytest.raises(RecordingError, match="too little of the same person"):
        synchrony.lateness(["a", "b"], lambda *_: (moving, np.full_like(moving, np.nan)), 5)
