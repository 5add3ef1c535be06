"""Recording folders: what a run sees of them, and what is said of bad ones."""

import json
import shutil
import tracemalloc
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.io.video import frame_rate
from mocapflow.io.video.reading import VIDEOS
from mocapflow.recordings.doctor import examine
from mocapflow.recordings.recording import open_recording
from tests.fixtures.recordings import NAMES, avi_frames, number_of, picture, ring, write_recording, write_video
from tests.io.cameras.test_calibration import write_easymocap

DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


def refused(folder, **settings):
    """Return the whole text of the error that opening a folder raises."""
    with pytest.raises(RecordingError) as caught:
        open_recording(folder, **settings)
    return str(caught.value)


def write_keypoints(folder, frames, change=None):
    for name in NAMES:
        place = folder / "keypoints" / f"{name}_json"
        place.mkdir(parents=True)
        for frame in range(frames):
            points = np.array([[10.0 + frame, 20, 0.9], [0, 0, 0], [30, 40, 0.5]])
            if change is not None:
                change(name, frame, points)
            people = [{"pose_keypoints_2d": points.ravel().tolist()}]
            (place / f"{name}.{frame:04d}.json").write_text(json.dumps({"people": people}))


def test_frames_of_all_cameras_in_order(tmp_path):
    recording = open_recording(write_recording(tmp_path, frames=10))
    assert (recording.frame_rate, recording.indices, recording.length) == (25.0, range(10), 10)
    assert recording.warnings == ()
    frames = list(recording.frames())
    assert [frame.index for frame in frames] == list(range(10))
    assert [frame.time for frame in frames] == [i / 25 for i in range(10)]
    assert [[number_of(image) for image in frame.images] for frame in frames] == [[i] * 3 for i in range(10)]
    assert all(frame.usable.all() and frame.reasons == () and frame.keypoints is None for frame in frames)


def test_a_part_and_going_on_in_it(tmp_path):
    recording = open_recording(write_recording(tmp_path, frames=20), start=2, stop=18, step=3)
    assert [frame.index for frame in recording.frames()] == [2, 5, 8, 11, 14, 17]
    assert [frame.index for frame in recording.frames(since=8)] == [8, 11, 14, 17]
    assert [frame.index for frame in recording.frames(since=9)] == [11, 14, 17]
    assert [frame.index for frame in recording.frames(since=0)] == [2, 5, 8, 11, 14, 17]
    assert list(recording.frames(since=18)) == []
    assert [list(recording.until(last).indices) for last in (7, 8, 99)] == [[2, 5], [2, 5, 8], [2, 5, 8, 11, 14, 17]]
    assert number_of(recording.frame(7).images[1]) == 7
    whole = {frame.index: frame.images for frame in recording.frames()}
    for frame in recording.frames(since=11):  # resumed: the same pixels
        for one, other in zip(frame.images, whole[frame.index], strict=True):
            np.testing.assert_array_equal(one, other)


def test_the_demo_is_whole():
    recording = open_recording(DEMO)
    assert (recording.frame_rate, recording.length, recording.warnings) == (30.0, 60, ())
    assert [camera.size.tolist() for camera in recording.cameras] == [[320, 400]] * 4
    assert recording.background() is not None
    assert recording.static() is None
    assert sorted(recording.content) == sorted(
        [
            "cameras.toml",
            *(f"videos/cam0{i}.mp4" for i in range(1, 5)),
            *(f"background/cam0{i}.png" for i in range(1, 5)),
        ]
    )


def test_nothing_of_truth_and_reference_is_content(tmp_path):
    shutil.copytree(DEMO, tmp_path / "a")
    shutil.rmtree(tmp_path / "a" / "truth")
    assert list(open_recording(tmp_path / "a").content) == list(open_recording(DEMO).content)


def test_scaled_and_undistorted(tmp_path):
    recording = open_recording(write_recording(tmp_path, frames=2, cameras=ring(distortion=(-0.1, 0.02))), scale=0.5)
    assert [camera.size.tolist() for camera in recording.cameras] == [[32, 24]] * 3
    assert not any(camera.distortion.any() for camera in recording.cameras)
    assert recording.lenses[0].distortion[0] == -0.1
    assert recording.frame(1).images[0].shape == (24, 32, 3)


def test_keypoints_come_with_the_frames(tmp_path):
    write_keypoints(write_recording(tmp_path, frames=3), 3)
    recording = open_recording(tmp_path)
    assert recording.warnings == ()
    frame = recording.frame(2)
    np.testing.assert_allclose(frame.keypoints[1], [[[12, 20, 0.9], [0, 0, 0], [30, 40, 0.5]]])
    assert "keypoints/cam02_json" in recording.content


def test_nan_in_keypoints_is_said_and_not_seen(tmp_path):
    def change(name, frame, points):
        if name == "cam02" and frame == 1:
            points[0, 0] = np.nan

    write_keypoints(write_recording(tmp_path, frames=3), 3, change)
    recording = open_recording(tmp_path)
    assert recording.warnings == (
        "cam02: keypoints of frame 1 are not all numbers (NaN): these points count as not seen",
    )
    np.testing.assert_array_equal(recording.frame(1).keypoints[1][0, 0], [0, 0, 0])


def test_static_trial_shares_the_calibration(tmp_path):
    write_recording(tmp_path, frames=3)
    write_recording(tmp_path / "static", frames=2)
    (tmp_path / "static" / "cameras.toml").unlink()
    static = open_recording(tmp_path, scale=0.5).static()
    assert static.length == 2
    assert [camera.size.tolist() for camera in static.cameras] == [[32, 24]] * 3
    assert static.content["cameras.toml"] == tmp_path / "cameras.toml"
    (tmp_path / "static" / "cameras.toml").write_bytes((tmp_path / "cameras.toml").read_bytes())
    assert open_recording(tmp_path).static().calibration == tmp_path / "static" / "cameras.toml"  # it has its own


def test_missing_camera(tmp_path):
    write_recording(tmp_path)
    (tmp_path / "videos" / "cam02.mp4").rename(tmp_path / "videos" / "side.mp4")
    assert refused(tmp_path) == (
        f"{tmp_path}  missing camera: no video of cam02\n"
        "       cameras.toml has: cam01, cam02, cam03\n"
        "       videos/ has: cam01, cam03, side\n"
        "       name each video after its camera, or remove the camera or the video that is too many;\n"
        f"       a video is a folder of images, or ends in {', '.join(VIDEOS)}"
    )
    write_cameras(tmp_path / "cameras.toml", [camera for camera in ring() if camera.name != "cam02"])
    assert "missing camera: no calibration of side\n" in refused(tmp_path)


def test_two_videos_of_one_camera(tmp_path):
    write_recording(tmp_path)
    write_video(tmp_path / "videos" / "cam02.mkv", 10)
    assert refused(tmp_path) == (
        f"{tmp_path / 'videos'}  two videos of cam02: cam02.mkv, cam02.mp4\n"
        "       which one is meant? move the other one out of videos/"
    )
    (tmp_path / "videos" / "cam02.mkv").unlink()
    (tmp_path / "videos" / "cam02").mkdir()
    assert "two videos of cam02: cam02, cam02.mp4" in refused(tmp_path)


def test_names_of_files_with_the_dots_of_an_umlaut_apart(tmp_path):
    """As macOS writes them."""
    write_recording(tmp_path, frames=2)
    apart = "Tu\u0308r"
    (tmp_path / "cameras.toml").write_text((tmp_path / "cameras.toml").read_text().replace("cam02", apart))
    (tmp_path / "videos" / "cam02.mp4").rename(tmp_path / "videos" / f"{apart}.mp4")
    for folder in (tmp_path / "background" / apart, tmp_path / "keypoints" / f"{apart}_json", tmp_path / "occluders"):
        folder.mkdir(parents=True)
    (tmp_path / "recording.json").write_text(json.dumps({"late_frames": {apart: 1}}))
    for place in (f"background/{apart}/0.png", f"occluders/{apart}.png"):
        cv2.imwrite(str(tmp_path / place), picture(0))
    recording = open_recording(tmp_path)
    assert [recording.lenses[1].name, recording.videos[1].late] == ["T\u00fcr", 1]
    assert recording.keypoint_folders == (None, tmp_path / "keypoints" / f"{apart}_json", None)
    assert {f"background/{apart}/0.png", f"occluders/{apart}.png"} <= set(recording.content)


def test_unequal_lengths(tmp_path):
    write_recording(tmp_path, frames=10, lengths={"cam03": 8})
    assert refused(tmp_path) == (
        f"{tmp_path / 'videos'}  the videos differ in length\n"
        "       cam01: 10 frames, cam02: 10 frames, cam03: 8 frames\n"
        "       cut them to the same moments: frame i must be the same instant in every video:\n"
        "       ffmpeg -i IN -ss SECONDS -frames:v 8 -crf 12 OUT; then `mocapflow doctor DIR --sync`"
    )


def test_truncated_video(tmp_path):
    write_recording(tmp_path, frames=20, ending="avi", codec="MJPG")
    path = tmp_path / "videos" / "cam02.avi"
    content = path.read_bytes()
    path.write_bytes(content[: avi_frames(content)[11][0] + 4])
    recording = open_recording(tmp_path)
    last = recording.videos[1].frames - 1
    assert last in (10, 11)
    assert recording.length == 20
    assert recording.warnings == (
        f"cam02: the video breaks off after frame {last} of 20; it is not used from there on",
    )
    frames = list(recording.frames())
    assert [number_of(frame.images[0]) for frame in frames] == list(range(20))
    usable = [bool(frame.usable[1]) for frame in frames]
    assert usable[:last] == [True] * last  # the last one is cut in the middle
    assert usable[last + 1 :] == [False] * (19 - last)
    assert frames[-1].reasons == ("", f"the video breaks off after frame {last}", "")
    assert not frames[-1].images[1].any()
    assert frames[-1].images[1].shape == (48, 64, 3)


def test_unreadable_video(tmp_path):
    write_recording(tmp_path)
    (tmp_path / "videos" / "cam02.mp4").write_bytes(b"hello")
    assert refused(tmp_path).startswith(f"{tmp_path / 'videos' / 'cam02.mp4'}  this video can't be decoded\n")


def test_calibration_in_mm(tmp_path):
    write_recording(tmp_path)
    cameras = [replace(c, camera_from_world=c.camera_from_world * [[1, 1, 1, 1000]]) for c in ring()]
    write_cameras(tmp_path / "cameras.toml", cameras)
    assert refused(tmp_path) == (
        f"{tmp_path / 'cameras.toml'}:1:3  camera 'cam01' stands 4272 m from the origin: the calibration is in mm\n"
        "       lengths are in metres: divide every translation by 1000"
    )


@pytest.mark.parametrize("size", [(100, 48), (64, 40), (60, 48), (66, 48)])
def test_image_size_against_calibration(tmp_path, size):
    write_recording(tmp_path)
    write_video(tmp_path / "videos" / "cam02.mp4", 10, size)
    place = f"{tmp_path / 'cameras.toml'}:10:3"
    assert refused(tmp_path) == (
        f"{place}  camera 'cam02': the video is {size[0]} x {size[1]} px, the calibration 64 x 48\n"
        "       calibrate at the size of the video, or scale size and matrix of the calibration to it"
    )


def test_a_video_turned_by_a_quarter(tmp_path):
    write_recording(tmp_path)
    write_video(tmp_path / "videos" / "cam02.mp4", 10, (48, 64))
    assert "the video is turned by a quarter, perhaps by a mark in the file" in refused(tmp_path)


def changed(tmp_path, matrix=None, distortion=None, fisheye=False):
    """Return a recording whose second camera has another matrix or lens."""
    cameras = list(ring())
    given = {"intrinsics": matrix, "distortion": distortion}
    new = {key: np.array(value, float) for key, value in given.items() if value is not None}
    cameras[1] = replace(cameras[1], fisheye=fisheye, **new)
    return write_recording(tmp_path, frames=2, cameras=cameras)


@pytest.mark.parametrize(("fx", "fy"), [(4.2, 4.2), (4.2, 60), (60, 4.2)])
def test_a_focal_length_in_millimetres(tmp_path, fx, fy):
    folder = changed(tmp_path, [[fx, 0, 31.5], [0, fy, 23.5], [0, 0, 1]])
    assert refused(folder).startswith(
        f"{tmp_path / 'cameras.toml'}:10:3  camera 'cam02' has a focal length of 4.2 px in pictures of 64\n"
        "       matrix is in pixels: "
    )


def test_cameras_whose_size_no_file_tells_are_no_rig_that_is_wrong(tmp_path):
    folder = changed(tmp_path, [[4.2, 0, 31.5], [0, 4.2, 23.5], [0, 0, 1]])
    write_easymocap(folder, read_cameras(folder), sizes=False)
    (folder / "cameras.toml").unlink()
    (told,) = [finding.message for finding in examine(folder) if finding.severity == "error"]
    assert told == "camera 'cam02' has a focal length of 4.2 px in pictures of 64"


@pytest.mark.parametrize(
    ("matrix", "distortion", "said"),
    [
        ([[60, 0, 0], [0, 60, 0], [0, 0, 1]], None, "principal point (0, 0) is not in its pictures of 64 x 48 px"),
        (
            [[60, 0, 63], [0, 60, 23.5], [0, 0, 1]],
            None,
            "principal point (63, 23.5) is not in its pictures",
        ),
        ([[60, 0, 31.5], [0, 60, 50], [0, 0, 1]], None, "principal point (31.5, 50) is not in its pictures"),
        (None, [-0.1, 0.1, 0.05, 0.001, 0], "tangential distortion moves pixels by "),
        (None, [-0.1, 0.1, 0.001, 0.05, 0], "tangential distortion moves pixels by "),
        (None, [-1.2, 0, 0, 0, 0], "distortion folds 20% of the undistorted picture, as no lens does"),
        (None, [3, 0, 0, 0, 0], "distortion folds 20% of the undistorted picture, as no lens does"),
        (None, [-3, 0, 0, 0, 0], "distortion folds 62% of the undistorted picture, as no lens does"),
        (None, [-0.3, 0.1, 0.002, 0.001, 0], ""),
        # of a GoPro: it folds what lies beyond the undistorted picture
        ([[28.6, 0, 32.2], [0, 29.2, 24.7], [0, 0, 1]], [-0.2576, 0.0877, -0.0003, -0.0006, -0.0152], ""),
    ],
)
def test_numbers_that_no_lens_has(tmp_path, matrix, distortion, said):
    warnings = open_recording(changed(tmp_path, matrix, distortion)).warnings
    assert [text[: len(said) + 11] for text in warnings[:1]] == ([f"cam02: its {said}"] if said else [])


def test_a_fisheye_has_no_tangential_coefficients(tmp_path):
    assert not open_recording(changed(tmp_path, distortion=[-0.1, 0.1, 0.05, 0.001, 0], fisheye=True)).warnings


def test_a_run_is_told_of_a_world_that_is_not_z_up(tmp_path):
    turned = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    cameras = [replace(c, camera_from_world=c.camera_from_world @ turned.T) for c in ring()]
    said = open_recording(write_recording(tmp_path, cameras=cameras)).warnings
    assert said[0].startswith("the images' up is the y axis of the world: the world has to be z up: turn ")


@pytest.mark.parametrize("late", [-40, -2, 2])
def test_a_camera_later_than_the_recording_is_long(tmp_path, late):
    write_recording(tmp_path, frames=2)
    (tmp_path / "recording.json").write_text(json.dumps({"late_frames": {"cam02": late}}))
    assert refused(tmp_path) == (
        f"{tmp_path / 'recording.json'}:1:19  camera 'cam02' is {late} frames late in a recording of 2\n"
        "       late_frames counts frames, not milliseconds; `mocapflow doctor DIR --sync` measures it"
    )


def test_slightly_smaller_images_were_cut(tmp_path):
    write_recording(tmp_path, frames=2, cameras=ring(size=(272, 480)))
    write_video(tmp_path / "videos" / "cam02.mp4", 2, (268, 480))
    recording = open_recording(tmp_path)
    assert recording.warnings == (
        "cam02: the video is 268 x 480 px, the calibration 272 x 480: taken as cut at the right and bottom",
    )
    assert recording.cameras[1].size.tolist() == [268, 480]
    np.testing.assert_array_equal(recording.cameras[1].intrinsics, ring(size=(272, 480))[1].intrinsics)
    assert recording.frame(0).images[1].shape == (480, 268, 3)


def test_folders_of_images(tmp_path):
    write_cameras(tmp_path / "cameras.toml", ring())
    for name in NAMES:
        (tmp_path / "videos" / name).mkdir(parents=True)
        for number in range(4):
            if (name, number) != ("cam02", 1):
                cv2.imwrite(str(tmp_path / "videos" / name / f"{number:06d}.png"), picture(number))
    recording = open_recording(tmp_path)
    assert recording.frame_rate == 30
    assert recording.warnings == (
        "cam02: frame 1 missing in the video; the view is not used there",
        "nothing says the frame rate: 30 frames per second assumed; write frame_rate under [metadata] in cameras.toml",
    )
    frame = recording.frame(1)
    assert frame.usable.tolist() == [True, False, True]
    assert frame.reasons == ("", "there is no image of this frame", "")
    with (tmp_path / "cameras.toml").open("a") as file:
        file.write("\n[metadata]\nframe_rate = 60\n")
    assert open_recording(tmp_path).frame_rate == 60


def test_folders_that_count_from_another_number(tmp_path):
    write_cameras(tmp_path / "cameras.toml", ring())
    for name, first in zip(NAMES, (1, 1, 0), strict=True):
        (tmp_path / "videos" / name).mkdir(parents=True)
        for number in range(4):
            cv2.imwrite(str(tmp_path / "videos" / name / f"{number + first}.png"), picture(number))
    assert refused(tmp_path) == (
        f"{tmp_path / 'videos'}  the videos differ in length\n"
        "       cam01: images 1 to 4, cam02: images 1 to 4, cam03: images 0 to 3\n"
        "       images of one instant have one number in all folders: number them anew, or remove what others lack; "
        "then `mocapflow doctor DIR --sync`"
    )


@pytest.mark.parametrize("first", [1, 240])
def test_frame_0_is_the_first_image_that_any_camera_has(tmp_path, first):
    write_cameras(tmp_path / "cameras.toml", ring())
    for name in NAMES:
        (tmp_path / "videos" / name).mkdir(parents=True)
        for number in range(name == "cam02", 4):
            cv2.imwrite(str(tmp_path / "videos" / name / f"{first + number:06d}.png"), picture(number))
    write_keypoints(tmp_path, 4)  # counted as OpenPose does for videos
    for number in (3, 2, 1, 0):  # named after the images
        place = tmp_path / "keypoints" / "cam02_json"
        (place / f"cam02.{number:04d}.json").rename(place / f"cam02.{first + number:04d}.json")
    recording = open_recording(tmp_path)
    assert (recording.length, recording.indices) == (4, range(4))
    assert recording.warnings[0] == f"the images are numbered from {first} on: number {first} is frame 0"
    assert not any("keypoints" in warning for warning in recording.warnings)
    frames = list(recording.frames())
    assert [number_of(frame.images[0]) for frame in frames] == [0, 1, 2, 3]
    assert frames[0].usable.tolist() == [True, False, True]
    assert number_of(frames[1].images[1]) == 1
    assert [[people.shape[0] for people in frame.keypoints] for frame in frames] == [[1, 1, 1]] * 4
    np.testing.assert_allclose([frame.keypoints[1][0, 0, 0] for frame in frames], [10, 11, 12, 13])


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        (range(4), {"cam02": [0]}),
        (range(4), {"cam01": [0], "cam02": [0, 3], "cam03": [0]}),
        (range(1, 5), {"cam02": [4]}),
    ],
)
def test_a_camera_without_keypoints_of_an_end_is_not_moved_by_a_frame(tmp_path, numbers, lost):
    write_cameras(tmp_path / "cameras.toml", ring())
    for name in NAMES:
        (tmp_path / "videos" / name).mkdir(parents=True)
        for number in range(4):
            cv2.imwrite(str(tmp_path / "videos" / name / f"{1 + number}.png"), picture(number))
        place = tmp_path / "keypoints" / f"{name}_json"
        place.mkdir(parents=True)
        for frame, number in enumerate(numbers):
            if number not in lost.get(name, []):
                people = [{"pose_keypoints_2d": [10.0 + frame, 20, 0.9]}]
                (place / f"{number}.json").write_text(json.dumps({"people": people}))
    frames = list(open_recording(tmp_path).frames())
    seen = np.array([[people[0, 0, 0] if len(people) else np.nan for people in frame.keypoints] for frame in frames])
    expected = np.full((4, 3), np.arange(10.0, 14)[:, None])
    for name, gone in lost.items():
        expected[[list(numbers).index(number) for number in gone], NAMES.index(name)] = np.nan
    np.testing.assert_array_equal(seen, expected)
    said = [finding.message for finding in examine(tmp_path) if finding.severity == "note"]
    first = numbers[0]
    assert f"the keypoints of frame 0 are numbered {first} of cam01, {first} of cam02, {first} of cam03" in said


@pytest.mark.parametrize("rate", ["'thirty'", "0", "-30.0", "nan", "true", "1e9", "1e-3"])
def test_a_frame_rate_that_is_none(tmp_path, rate):
    write_recording(tmp_path, frames=2)
    with (tmp_path / "cameras.toml").open("a") as file:
        file.write(f"[metadata]\nframe_rate = {rate}\n")
    assert ":28:1  frame_rate is " in refused(tmp_path)


def test_different_frame_rates(tmp_path):
    write_recording(tmp_path, frames=4)
    write_video(tmp_path / "videos" / "cam02.mp4", 4, rate=50.0)
    said = "the videos differ in frame rate\n       cam01: 25 per second, cam02: 50 per second"
    assert said in refused(tmp_path)
    shutil.move(tmp_path / "videos", tmp_path / "static" / "videos")
    calibration = tmp_path / "cameras.toml"
    assert f"{tmp_path}/static/videos  {said}" in refused(tmp_path / "static", calibration=calibration)


@pytest.mark.parametrize(("rate", "apart"), [(25.2, False), (25.3, True)])
def test_frame_rates_that_differ_by_more_than_a_hundredth(tmp_path, rate, apart):
    write_recording(tmp_path, frames=4)
    write_video(tmp_path / "videos" / "cam02.mp4", 4, rate=rate)
    if apart:
        assert "the videos differ in frame rate" in refused(tmp_path)
    else:
        assert open_recording(tmp_path).frame_rate == 25


def test_a_stated_frame_rate_does_not_hide_that_the_videos_differ(tmp_path):
    write_recording(tmp_path, frames=4)
    write_video(tmp_path / "videos" / "cam02.mp4", 4, rate=50.0)
    with (tmp_path / "cameras.toml").open("a") as file:
        file.write("[metadata]\nframe_rate = 1\n")  # as slow as it may be
    found = open_recording(tmp_path)
    (said,) = found.warnings
    assert said.startswith("the videos differ in frame rate (cam01: 25 per second, cam02: 50 per second, cam03: 25")
    assert said.endswith("1 is taken for all") and found.frame_rate == 1


@pytest.mark.parametrize("stated", ["", "[metadata]\nframe_rate = 25\n"])
@pytest.mark.parametrize(("rate", "apart"), [(25.1, ()), (25.2, ("0.3",))])
def test_rates_that_are_nearly_one(tmp_path, monkeypatch, rate, apart, stated):
    monkeypatch.setattr(frame_rate, "OFF", 0.3)
    write_recording(tmp_path, frames=40)
    with (tmp_path / "cameras.toml").open("a") as file:
        file.write(stated)
    write_video(tmp_path / "videos" / "cam02.mp4", 40, rate=rate)
    found = open_recording(tmp_path)
    assert found.frame_rate == 25
    assert [said[:47] for said in found.warnings] == [f"at their end the videos are {n} frames apart (c" for n in apart]
    assert len(examine(tmp_path)) >= len(apart)


def test_a_frame_rate_that_varies(tmp_path):
    write_recording(tmp_path, frames=60)
    path = tmp_path / "videos" / "cam02.mp4"
    times = [*range(0, 3000, 100), *range(3000, 3000 + 30 * 130, 130)]
    with av.open(str(path), "w") as file:
        stream = file.add_stream("mpeg4", rate=25, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt, stream.time_base = 64, 48, "yuv420p", Fraction(1, 2500)
        stream.codec_context.time_base = stream.time_base
        for number, time in enumerate(times):
            frame = av.VideoFrame.from_ndarray(picture(number), "bgr24")
            frame.pts = time
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    with (tmp_path / "cameras.toml").open("a") as file:
        file.write("[metadata]\nframe_rate = 250\n")  # slow motion
    found = open_recording(tmp_path)
    said = found.warnings
    assert found.frame_rate == 250
    assert said[0].startswith("cam02: its frame rate varies, which puts frames up to ")
    assert "ffmpeg -i IN -vf fps=25 " in said[0]
    assert said[0] in [finding.message for finding in examine(tmp_path)]


def test_a_camcorder_s_interlaced_video(tmp_path):
    write_recording(tmp_path, frames=6)
    (tmp_path / "videos" / "cam02.mp4").unlink()
    with av.open(str(tmp_path / "videos" / "cam02.MTS"), "w", format="mpegts") as file:
        stream = file.add_stream("libx264", rate=25, options={"x264-params": "tff=1"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(6):
            frame = av.VideoFrame.from_ndarray(picture(number), "bgr24")
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    (said,) = open_recording(tmp_path).warnings
    assert said.startswith("cam02: its video is interlaced, each picture shows two moments; ffmpeg ")


def test_a_calibration_that_has_no_place_for_a_frame_rate(tmp_path):
    write_easymocap(tmp_path, ring())
    for name in NAMES:
        (tmp_path / "videos" / name).mkdir(parents=True)
        cv2.imwrite(str(tmp_path / "videos" / name / "0.png"), picture(0))
    (said,) = open_recording(tmp_path).warnings
    assert said.endswith("write frame_rate under [metadata] in a cameras.toml, which this calibration has to become")


@pytest.mark.parametrize("part", [{"start": 10}, {"stop": 11}, {"start": 5, "stop": 5}, {"start": -1}])
def test_frames_that_are_not_there(tmp_path, part):
    assert refused(write_recording(tmp_path), **part).endswith("it has 10 frames: 0:10")


def test_wrong_arguments(tmp_path):
    assert refused(tmp_path / "nowhere").endswith("nowhere  no such recording folder")
    write_recording(tmp_path)
    for scale in (2, 0, -0.5):
        assert refused(tmp_path, scale=scale).startswith(f"the scale is {scale}; expected")
    open_recording(tmp_path, scale=0.17)  # 8.16 of 48 px
    for scale in (0.16, 0.01):
        assert refused(tmp_path, scale=scale).startswith(f"the scale {scale} leaves images of less than 8 pixels")
    with pytest.raises(RecordingError, match="no frame 10: the videos have frames 0 to 9"):
        open_recording(tmp_path).frame(10)


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    peaks = []
    for frames in (30, 300):
        folder = write_recording(tmp_path / str(frames), frames=frames, ending="avi", codec="MJPG")
        recording = open_recording(folder)
        tracemalloc.start()
        assert sum(1 for _ in recording.frames()) == frames
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 2e5  # ten times the frames: 270 x 3 views x 9 kB would be 7 MB


def test_keypoints_of_a_late_camera_are_those_of_its_later_pictures(tmp_path):
    write_keypoints(write_recording(tmp_path, frames=8), 8)
    (tmp_path / "recording.json").write_text('{"late_frames": {"cam02": 2}}')
    recording = open_recording(tmp_path)
    assert [people[0, 0, 0] for people in recording.people(3)] == [13, 15, 13]  # as `write_keypoints` has them
    assert [len(people) for people in recording.people(7)] == [1, 0, 1]
