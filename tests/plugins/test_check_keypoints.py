"""Hands and feet beside 2D keypoints: which frames are doubted, and what is not compared."""

import json
from dataclasses import replace

import numpy as np
import pytest
from keypoint_recording import copy_demo, template, write
from mocapflow_recovery.check_keypoints import CheckKeypoints
from mocapflow_sequence.join import cut
from results_scene import demo_scene, stepping, tube

from mocapflow.geometry.kinematics import joint_centres
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ViewChecks
from mocapflow.scene import Scene

BODY = template()
TRUE = replace(stepping(BODY, 6), notes=("frame 1: cam01 black", "frame 5: fitted again"))
SCENE = Scene(cameras=demo_scene().cameras, body=BODY)
KNEE, ANKLE = BODY.screw_names.index("knee_l.flexion"), BODY.joint("ankle_l")


def astray(*rows, bent=KNEE, by=0.7):
    """The track with a joint bent more in some rows, by 40 degrees."""
    angles = TRUE.angles.copy()
    angles[list(rows), bent] += by
    return replace(TRUE, angles=angles)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A recording whose keypoints are right, beside a bystander."""
    place = copy_demo(tmp_path_factory.mktemp("marked") / "recording")
    write(place, BODY, [TRUE.pose(row) for row in range(6)], SCENE.cameras)
    return place


@pytest.fixture
def recording(folder):
    return open_recording(folder, stop=6)


def off_cm(track):
    """How far the left ankle of each row is from its true place."""
    ankles = [joint_centres(BODY, each.root, each.angles)[:, ANKLE] for each in (track, TRUE)]
    return 100 * np.linalg.norm(ankles[0] - ankles[1], axis=1)


def test_a_track_that_is_right_is_left_alone(recording, caplog):
    checked = CheckKeypoints().run(TRUE, recording, SCENE)
    assert not checked.doubted.any() and checked.notes == TRUE.notes and not caplog.messages


def test_a_leg_elsewhere_is_doubted_and_told(recording, caplog):
    track = replace(astray(2, 4), doubted=TRUE.frame == 0)
    checked = CheckKeypoints().run(track, recording, SCENE)
    assert np.flatnonzero(checked.doubted).tolist() == [0, 2, 4]
    first, *found, last = checked.notes
    assert (first, last) == TRUE.notes
    assert found == [f"frame {row}: keypoints have ankle_l elsewhere" for row in (2, 4)]
    (message,) = caplog.messages
    told, _, most = message.partition(" in 2 of 6 frames, by up to ")
    assert told == "keypoints have ankle_l elsewhere"
    assert float(most.partition(" cm:")[0]) == pytest.approx(off_cm(track).max(), abs=1.5)
    np.testing.assert_array_equal(checked.angles, track.angles)


@pytest.mark.parametrize("bent, by, end", [("hip_r.flexion", 0.4, "ankle_r"), ("elbow_l.flexion", 0.7, "wrist_l")])
def test_the_ends_of_limbs_are_compared(recording, bent, by, end):
    checked = CheckKeypoints().run(astray(2, bent=BODY.screw_names.index(bent), by=by), recording, SCENE)
    assert set(checked.notes) == {*TRUE.notes, f"frame 2: keypoints have {end} elsewhere"}


def test_a_foot_turned_is_doubted_and_told(recording, caplog):
    """Its ankle is where it is marked."""
    turned = astray(1, 3, bent=BODY.screw_names.index("ankle_r.dorsiflexion"), by=np.radians(50))
    checked = CheckKeypoints().run(turned, recording, SCENE)
    assert np.flatnonzero(checked.doubted).tolist() == [1, 3]
    found = [f"frame {row}: keypoints have ankle_r turned otherwise" for row in (1, 3)]
    assert set(checked.notes) == {*TRUE.notes, *found}
    (message,) = caplog.messages
    told, _, most = message.partition(" in 2 of 6 frames, by up to ")
    assert told == "keypoints have ankle_r turned otherwise"
    assert float(most.partition(" degrees:")[0]) == pytest.approx(50, abs=6)
    assert not CheckKeypoints(turned_deg=60).run(turned, recording, SCENE).doubted.any()


def test_feet_are_not_compared_where_toes_are_not_marked(folder, tmp_path):
    turned = astray(1, bent=BODY.screw_names.index("ankle_r.dorsiflexion"), by=np.radians(50))
    toeless = spoilt(folder, tmp_path, lambda number, points: points[22:25].fill(0))
    assert not CheckKeypoints().run(turned, toeless, SCENE).doubted.any()


def test_what_counts_as_elsewhere_is_a_setting(recording):
    track = astray(3)
    near, far = (
        CheckKeypoints(apart_m=off_cm(track)[3] / 100 + by).run(track, recording, SCENE) for by in (-0.02, 0.02)
    )
    assert near.doubted.any() and not far.doubted.any()


def test_a_recording_without_keypoints_is_left_alone(recording, caplog):
    track = astray(2)
    none = replace(recording, keypoint_folders=(None,) * 4)
    assert CheckKeypoints().run(track, none, SCENE) is track
    assert not caplog.messages


def test_joints_near_a_garment_are_not_compared(recording):
    low = tube(BODY)
    low = replace(low, vertices=low.vertices - [0.0, 0.0, 0.4])
    checked = CheckKeypoints().run(astray(2), recording, replace(SCENE, garment=low))
    assert not checked.doubted.any()
    high = CheckKeypoints().run(astray(2), recording, replace(SCENE, garment=tube(BODY)))
    assert high.doubted.any()


def spoilt(folder, place, change):
    """Copy a recording's keypoints with `change` made to those of the person, (25, 3), by the number of the camera."""
    copied = copy_demo(place / "spoilt")
    for number, view in enumerate(sorted((folder / "keypoints").iterdir())):
        (copied / "keypoints" / view.name).mkdir(parents=True)
        for file in view.iterdir():
            people = json.loads(file.read_text())["people"]
            points = np.reshape(people[-1]["pose_keypoints_2d"], (-1, 3))
            change(number, points)
            people[-1]["pose_keypoints_2d"] = points.ravel().tolist()
            (copied / "keypoints" / view.name / file.name).write_text(json.dumps({"people": people}))
    return open_recording(copied, stop=6)


def seen_larger(folder, place, offs, by):
    """Return the doubts of a leg astray whose ankle cameras mark so far off, (x, y) px, in images so much larger."""

    def change(number, points):
        points[15, :2] += offs[number]
        points[:, :2] *= by

    size = np.diag([by, by, 1.0])
    cameras = tuple(replace(camera, intrinsics=size @ camera.intrinsics) for camera in SCENE.cameras)
    return CheckKeypoints().run(astray(2), spoilt(folder, place, change), replace(SCENE, cameras=cameras)).doubted


@pytest.mark.parametrize("by", [0.1, 1.0, 10.0])
def test_three_cameras_have_to_agree(folder, tmp_path, by):
    """Two of four cameras mark the ankle right; the two others each somewhere else."""
    offs = [(0.0, 0.0), (90.0, -70.0), (0.0, 0.0), (-40.0, 110.0)]
    assert not seen_larger(folder, tmp_path, offs, by).any()


@pytest.mark.parametrize("by", [0.1, 1.0, 10.0])
def test_cameras_agree_but_for_usual_errors(folder, tmp_path, by):
    """Three do; the fourth marks something else."""
    offs = [(-7.0, 0.0), (7.0, 0.0), (90.0, -70.0), (7.0, 0.0)]
    assert np.flatnonzero(seen_larger(folder, tmp_path, offs, by)).tolist() == [2]


def test_frames_are_those_of_the_videos(recording):
    later = cut(astray(4), TRUE.frame >= 3)
    checked = CheckKeypoints().run(later, recording, SCENE)
    assert checked.frame[checked.doubted].tolist() == [4]


def test_lost_frames_are_guesses_anyway(recording, caplog):
    track = astray(2, 4)
    checked = CheckKeypoints().run(replace(track, iterations=track.iterations * (track.frame != 2)), recording, SCENE)
    assert np.flatnonzero(checked.doubted).tolist() == [4]
    assert " in 1 of 6 frames" in caplog.text


def test_where_two_cameras_have_keypoints_both_are_enough(folder, recording):
    folders = tuple(place if number < 2 else None for number, place in enumerate(recording.keypoint_folders))
    checked = CheckKeypoints().run(astray(2), replace(recording, keypoint_folders=folders), SCENE)
    assert np.flatnonzero(checked.doubted).tolist() == [2]


def test_wrong_views_are_left_out(recording):
    """With three of four pictures of the frame known to be wrong, nothing places its keypoints."""
    checks = ViewChecks(frame=np.full(3, 2, np.int32), camera=np.arange(3, dtype=np.int16), reasons=("torn",) * 3)
    checked = CheckKeypoints().run(astray(2, 3), recording, SCENE, checks)
    assert np.flatnonzero(checked.doubted).tolist() == [3]


def test_keypoints_of_nobody_are_told_and_do_no_harm(folder, tmp_path, caplog):
    nobody = spoilt(folder, tmp_path, lambda number, points: None)
    for file in (nobody.folder / "keypoints").rglob("*.json"):
        file.write_text('{"people": []}')
    track = astray(2)
    assert CheckKeypoints().run(track, nobody, SCENE) is track
    assert caplog.messages[0].startswith("the track is not compared with the keypoints: ")
