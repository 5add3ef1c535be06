"""The first frame beside its clean plates and the first pose: files of two cameras exchanged, a pose far off."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned

from mocapflow.help.shipped import shipped
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.recordings.first_look import examine_first_frame
from mocapflow.registry import load_registry


@pytest.fixture
def clip(tmp_path):
    return shutil.copytree(shipped("examples", "data", "skirt_steps"), tmp_path / "clip")


def said(folder):
    return [finding.message for finding in examine_first_frame(folder, load_registry())]


def test_a_good_recording_has_nothing_odd_nor_one_without_plates_or_pose(clip):
    assert said(clip) == []
    (clip / "recording.json").write_text('{"late_frames": {"cam02": -1}}')  # it has no first frame
    assert said(clip) == []
    (clip / "init.json").unlink()
    assert said(clip) == []
    shutil.rmtree(clip / "background")
    assert said(clip) == []


def exchange(folder, ending):
    one, other, aside = (folder / f"{name}.{ending}" for name in ("cam01", "cam02", "aside"))
    one.rename(aside)
    other.rename(one)
    aside.rename(other)


def test_videos_of_two_cameras_that_are_exchanged(clip):
    exchange(clip / "videos", "mp4")
    assert said(clip) == ["the first frame of cam01, cam02 is not of the room in its clean plate"]
    exchange(clip / "background", "png")
    assert said(clip) == ["nobody stands where the first pose says in cam01, cam02"]


@pytest.mark.long
def test_a_first_pose_where_nobody_stands(clip, monkeypatch):
    pose = json.loads((clip / "init.json").read_text())
    pose["root_translation"][0] += 0.8
    (clip / "init.json").write_text(json.dumps(pose))
    assert said(clip) == ["nobody stands where the first pose says"]
    load = Scanned.load  # a body that a run refuses says nothing of where it stands
    monkeypatch.setattr(Scanned, "load", lambda *at: replace(b := load(*at), skin_weight=2 * b.skin_weight))
    assert said(clip) == []


def test_a_matrix_of_pictures_of_another_size(clip):
    half = np.array([[0.5, 1, 1], [1, 0.5, 1], [1, 1, 1]])
    halved = [replace(camera, intrinsics=half * camera.intrinsics) for camera in read_cameras(clip / "cameras.toml")]
    write_cameras(clip / "cameras.toml", halved)
    assert said(clip) == ["at the first pose the body is 0.5 times as tall as who is seen"]


@pytest.mark.parametrize("count", [1, 4])
def test_the_person_is_in_a_clean_plate(clip, count):
    names = [camera.name for camera in read_cameras(clip / "cameras.toml")][:count]
    for name in names:
        _, first = cv2.VideoCapture(str(clip / "videos" / f"{name}.mp4")).read()
        cv2.imwrite(str(clip / "background" / f"{name}.png"), first)
    assert said(clip) == [f"the first frame of {', '.join(names)} differs nowhere from its clean plate"]


def test_a_body_that_the_pictures_cut_is_not_measured(clip):
    pose = json.loads((clip / "init.json").read_text())
    pose["root_translation"][2] = 0.0
    (clip / "init.json").write_text(json.dumps(pose))
    assert said(clip) == ["nobody stands where the first pose says in cam04"]


def test_a_camera_whose_calibration_is_another_s(clip):
    cameras = list(read_cameras(clip / "cameras.toml"))
    moved = cameras[1].camera_from_world.copy()
    moved[0, 3] += 0.5
    cameras[1] = replace(cameras[1], camera_from_world=moved)
    write_cameras(clip / "cameras.toml", cameras)
    assert said(clip) == [f"nobody stands where the first pose says in {cameras[1].name}"]
    furniture = np.full(cameras[1].size[::-1], 255, np.uint8)
    furniture[:, :30] = 0
    (clip / "occluders").mkdir()
    cv2.imwrite(str(clip / "occluders" / f"{cameras[1].name}.png"), furniture)
    assert said(clip) == []  # nobody can see there
