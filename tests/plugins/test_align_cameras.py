"""Cameras knocked since their calibration: found and turned back; good cameras are left alone."""

import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest
from keypoint_recording import DEMO, copy_demo, write
from mocapflow_fitting.align_cameras import AlignCameras, moved_px, turn
from mocapflow_fitting.start_from_file import read_pose

from mocapflow.data import Pose
from mocapflow.geometry import twists
from mocapflow.geometry.cameras import project
from mocapflow.recordings.recording import open_recording


def walking(body, count):
    """Return poses that wander through the room."""
    first, rng = read_pose(DEMO / "init.json", body), np.random.default_rng(7)
    shifts = np.column_stack([rng.uniform(-0.3, 0.3, (count, 2)), np.zeros(count)])
    turns = [twists.exp(np.append(np.zeros(3), shift)) for shift in shifts]
    return [Pose(root=motion @ first.root, angles=first.angles * rng.uniform(-1, 1)) for motion in turns]


def aligned(folder, body, cameras, least_px, frames=8):
    write(folder, body, walking(body, 8), cameras, noise_px=0.7, bystander=())
    return AlignCameras(frames=frames, sigma_px=1.0, least_px=least_px).run(open_recording(folder, stop=8)).cameras


@pytest.mark.long
def test_good_cameras_are_left_as_they_are(body, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    cameras = open_recording(folder).cameras
    found = aligned(folder, body, cameras, 1.0)
    assert all(np.array_equal(a.camera_from_world, b.camera_from_world) for a, b in zip(found, cameras, strict=True))


@pytest.mark.long
def test_a_knocked_camera_is_turned_back(body, tmp_path, caplog):
    folder = copy_demo(tmp_path / "recording")
    cameras = open_recording(folder).cameras
    knock = np.zeros((4, 3))
    knock[1] = np.radians([0.3, 0.8, 0.2])
    with caplog.at_level(logging.WARNING, "mocapflow"):
        found = aligned(folder, body, turn(cameras, knock), 1.0)  # what the cameras see, against what the file says
    truth = turn(cameras, knock)
    before, after = moved_px(cameras[1], truth[1]), moved_px(found[1], truth[1])
    assert before > 4 and after < 0.35 * before
    assert "cameras have turned since their calibration" in caplog.text


def test_what_only_two_cameras_see_tells_nothing(body, tmp_path, caplog):
    folder = copy_demo(tmp_path / "recording")
    cameras = open_recording(folder).cameras
    write(folder, body, walking(body, 8), cameras, noise_px=0.7, bystander=())
    for view in sorted((folder / "keypoints").iterdir())[2:]:
        shutil.rmtree(view)
    with caplog.at_level(logging.WARNING, "mocapflow"):
        found = AlignCameras(frames=8).run(open_recording(folder, stop=8)).cameras
    assert all(np.array_equal(a.camera_from_world, b.camera_from_world) for a, b in zip(found, cameras, strict=True))
    assert "no keypoint is seen by three cameras" in caplog.text


def test_of_two_cameras_both_have_to_see_it(body, tmp_path, caplog):
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, walking(body, 1), open_recording(folder).cameras, noise_px=0.7, bystander=())
    whole = open_recording(folder, stop=1)
    pair = {name: getattr(whole, name)[:2] for name in ("views", "videos", "keypoint_folders")}
    assert len(AlignCameras().run(replace(whole, **pair)).cameras) == 2
    assert "seen by three" not in caplog.text


def test_the_first_frame_alone_can_do(body, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    cameras = open_recording(folder).cameras
    knock = np.zeros((4, 3))
    knock[1] = np.radians([0.3, 0.8, 0.2])
    truth = turn(cameras, knock)
    found = aligned(folder, body, truth, 1.0, frames=1)
    assert moved_px(found[1], truth[1]) < 0.5 * moved_px(cameras[1], truth[1])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_shift_is_that_of_the_picture_about_any_axis(axis):
    camera = open_recording(DEMO).cameras[0]
    (other,) = turn([camera], np.radians(0.5) * np.eye(3)[axis : axis + 1])
    lever = camera.intrinsics[0, 0] if axis < 2 else camera.size.max() / 2  # px
    assert moved_px(camera, other) == pytest.approx(lever * np.radians(0.5), rel=0.3)
    same = replace(camera, camera_from_world=camera.camera_from_world.copy())
    assert moved_px(camera, same) < 1e-9


def test_a_camera_turns_as_far_as_keypoints_are_sure_and_its_mount_is_loose():
    cameras, knock = open_recording(DEMO).cameras, np.zeros((4, 3))
    knock[1] = np.radians([0.3, 0.8, 0.2])
    truth = turn(cameras, knock)
    points = np.random.default_rng(3).uniform((-0.5, -0.5, 0.2), (0.5, 0.5, 1.7), (25, 3))
    pixels, seen = np.stack([project(points, camera) for camera in truth]), np.ones((4, 25))
    pixels[0, :2] += 80.0  # two of them are mistaken, which pulls no harder the farther they are off
    far = moved_px(cameras[1], truth[1])
    (sure, unsure, tight) = (
        AlignCameras(sigma_px=sigma, spread_deg=spread)._turned(cameras, pixels, seen)[1]
        for sigma, spread in ((1.0, 0.5), (500.0, 0.5), (1.0, 0.001))
    )
    assert moved_px(sure, truth[1]) < 0.35 * far
    assert max(moved_px(each, cameras[1]) for each in (unsure, tight)) < 0.1 * far
