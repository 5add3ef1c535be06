"""Where pictures show people, by their keypoints, and that it is not taken for the room."""

import json
from dataclasses import replace

import numpy as np
import pytest
from keypoint_recording import copy_demo, template, write
from mocapflow_fitting.keypoint_layouts import LAYOUTS
from mocapflow_sequence.background import EmptyScene
from mocapflow_sequence.first_frame import empty_scene
from mocapflow_sequence.people import REACH, near, people_seen
from results_scene import demo_scene, stepping

from mocapflow.data import Start
from mocapflow.recordings.recording import open_recording
from tests.fixtures.patterned_room import taken

NAMES = LAYOUTS["coco_17"]
SHAPE = (200, 160, 3)
STANDING = {  # px, of somebody with spread legs
    "nose": (80, 20), "shoulder_l": (95, 40), "shoulder_r": (65, 40), "elbow_l": (110, 70), "elbow_r": (50, 70),
    "wrist_l": (110, 100), "wrist_r": (50, 100), "hip_l": (90, 100), "hip_r": (70, 100), "knee_l": (105, 140),
    "knee_r": (55, 140), "ankle_l": (115, 180), "ankle_r": (45, 180),
}  # fmt: skip
REACH_PX = REACH * np.hypot(70, 160)


def figure(**changes):
    """Keypoints (17, 3) of the standing figure, with other places of some; None: unseen."""
    places = STANDING | changes
    return np.array([(*places[name], 0.9) if places.get(name) else (0, 0, 0) for name in NAMES], float)


@pytest.mark.parametrize(("x", "y", "shown"), [
    (80, 70, True),  # trunk
    (110, 160, True), (50, 160, True),  # shanks
    (80, 130, True),  # a skirt between the knees
    (80, 175, False),  # between the feet
    (110 + REACH_PX - 2, 85, True), (110 + REACH_PX + 2, 85, False),  # beside a forearm
    (130, 20, False),
])  # fmt: skip
def test_a_person_covers_limbs_trunk_and_what_hangs_between_the_knees(x, y, shown):
    assert near(figure(), NAMES, SHAPE)[round(y), int(x)] == shown


def test_what_is_not_seen_or_outside_of_the_picture_covers_nothing():
    assert not near(figure(knee_l=None, ankle_l=None), NAMES, SHAPE)[165, 112]
    assert near(figure(ankle_l=(115, 1e9)), NAMES, SHAPE)[150, 106]
    assert not near(figure(**dict.fromkeys(STANDING)), NAMES, SHAPE).any()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Keypoints of a person, and in two views of a bystander."""
    body = template()
    place = copy_demo(tmp_path_factory.mktemp("seen") / "recording")
    write(place, body, [stepping(body).pose(0)] * 60, demo_scene().cameras, noise_px=0.0)
    return place


def test_everybody_who_is_seen_is_a_person(folder):
    recording = open_recording(folder)
    for camera, count in ((0, 2), (1, 1)):
        people = people_seen(recording, camera, [0, 1])
        shape = (400, 320, 3)
        each = [near(points, people.names, shape) for points in recording.people(1)[camera]]
        assert len(each) == count
        np.testing.assert_array_equal(people.beside(1, shape), ~np.logical_or.reduce(each))


def test_without_keypoints_nobody_is_known_to_be_seen(folder):
    recording = replace(open_recording(folder), keypoint_folders=(None,) * 4)
    assert people_seen(recording, 0, [0]).beside(0, SHAPE).all()


def test_keypoints_of_an_unknown_order_are_told_and_left_out(folder, tmp_path, caplog):
    copied = copy_demo(tmp_path / "recording")
    for file in (folder / "keypoints").rglob("*.json"):
        (copied / file.relative_to(folder)).parent.mkdir(parents=True, exist_ok=True)
        three = {"people": [{"pose_keypoints_2d": [10.0, 10.0, 0.9] * 3}]}
        (copied / file.relative_to(folder)).write_text(json.dumps(three))
    people = people_seen(open_recording(copied), 0, [0])
    assert people.beside(0, SHAPE).all()
    (message,) = caplog.messages
    assert message.startswith(
        "keypoints do not tell where people are while the empty room is learnt: detections with 3"
    )


def in_socks(nobody):
    """Learn the room of somebody in socks like the floor who stays in place; return what is known, and the socks."""
    shown, empty, mask, body, camera = taken([0] * 20)
    socks = mask.copy()
    socks[:180] = False
    shown[:, socks] = np.roll(empty, 60, axis=1)[socks] + np.random.default_rng(0).normal(0, 2, (20, socks.sum(), 3))
    beside = None if nobody is None else np.broadcast_to(nobody(mask), shown.shape[:3])
    found = empty_scene(shown, shown[0], body, camera, beside, None if nobody is None else beside[0])
    return found.known, socks, mask


def test_socks_like_the_floor_are_not_the_room_where_keypoints_have_somebody():
    known, socks, mask = in_socks(None)
    assert known[socks].mean() > 0.3
    known, socks, mask = in_socks(lambda mask: ~mask)
    assert not known[socks].any() and known[~mask].mean() > 0.97


@pytest.mark.parametrize("started", [True, False])
def test_the_stage_goes_by_the_keypoints(folder, started):
    """With somebody in the middle of all pictures the floor behind them stays unknown, whatever its colours are."""
    recording, scene = open_recording(folder), demo_scene()
    pose = stepping(scene.body).pose(0)
    start = Start(pose=pose, parameters=np.zeros(0)) if started else None
    with_nobody = EmptyScene(source="recording").run(replace(recording, keypoint_folders=(None,) * 4), scene, start)
    found = EmptyScene(source="recording").run(recording, scene, start)
    for camera in range(4):
        beside = people_seen(recording, camera, [0]).beside(0, found.mean[camera].shape)
        assert not found.known[camera][~beside].any()
        assert with_nobody.known[camera][~beside].mean() > 0.2
        assert found.known[camera][beside].mean() > 0.9
