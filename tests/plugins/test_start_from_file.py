"""The first pose from a file: the forward kinematics of the recordings' README, and what may be wrong with it."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned
from mocapflow_fitting.start_from_file import StartFromFile
from scipy.spatial.transform import Rotation

from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.geometry.cameras import project
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene
from tests.fixtures.turns import rotations_from_angles

RECORDING = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


@pytest.fixture(scope="module")
def scene():
    return Scene(cameras=open_recording(RECORDING).cameras, body=Scanned().load(RECORDING))


@pytest.fixture
def recording(tmp_path):
    shutil.copytree(RECORDING, tmp_path / "recording")
    return tmp_path / "recording"


def readme_kinematics(body, content, turns):
    """G_j = G_parent R_j, p_j = p_parent + G_parent (rest_j - rest_parent), v = sum w (G_j (v_rest - rest_j) + p_j)."""
    rotations, positions = [], []
    for joint, name in enumerate(body.joint_names):
        parent = body.parents[joint]
        if parent < 0:
            rotations.append(Rotation.from_rotvec(content["root_rotation"]).as_matrix())
            positions.append(np.array(content["root_translation"]))
        else:
            own = Rotation.from_rotvec(turns[name]).as_matrix()
            rotations.append(rotations[parent] @ own)
            offset = body.positions[joint] - body.positions[parent]
            positions.append(positions[parent] + rotations[parent] @ offset)
    vertices = np.zeros_like(body.vertices)
    for k in range(5):
        joint = body.skin_joint[:, k]
        local = body.vertices - body.positions[joint]
        moved = np.einsum("vab,vb->va", np.array(rotations)[joint], local) + np.array(positions)[joint]
        vertices += body.skin_weight[:, k, None] * moved
    return np.array(positions), vertices


def test_body_and_pose_reproduce_the_recordings_kinematics(scene):
    content = json.loads((RECORDING / "init.json").read_text())
    pose = StartFromFile().run(open_recording(RECORDING), scene).pose
    turns = rotations_from_angles(scene.body, pose.angles)
    given = content["joint_rotations"]
    inexact = {name for name in given if np.abs(np.array(given[name]) - turns[name]).max() > 1e-9}
    assert inexact <= {"toe_l", "toe_r", "wrist_l", "wrist_r"}  # joints with fewer than three screws
    positions, vertices = readme_kinematics(scene.body, content, turns)
    joints, _ = kinematics.chain(scene.body, pose)
    np.testing.assert_allclose(kinematics.joint_positions(scene.body, joints), positions, atol=1e-9)
    np.testing.assert_allclose(kinematics.skin(scene.body, joints, pose.angles), vertices, atol=1e-9)


def test_a_part_of_the_body_starts_from_the_same_file(scene):
    legs = Scene(cameras=scene.cameras, body=Scanned(part="legs").load(RECORDING))
    pose = StartFromFile().run(open_recording(RECORDING), legs).pose
    whole = StartFromFile().run(open_recording(RECORDING), scene).pose
    knee = kinematics.joint_positions(legs.body, kinematics.chain(legs.body, pose)[0])[legs.body.joint("knee_r")]
    other = kinematics.joint_positions(scene.body, kinematics.chain(scene.body, whole)[0])[scene.body.joint("knee_r")]
    np.testing.assert_allclose(knee, other, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c["joint_rotations"].update(knee=[0, 0, 0]), "no joint 'knee'\n.*did you mean 'knee_"),
        (
            lambda c: c.update(root_rotation=[0, float("nan"), 0]),
            "'root_rotation' is .*nan.*\n.*three finite",
        ),
        (
            lambda c: c["joint_rotations"].update(knee_l=[0, 0]),
            r"'knee_l' is \[0, 0\]\n.*three finite",
        ),
        (lambda c: c["joint_rotations"].update(knee_l=[20, -4, 2]), "'knee_l' turns by 20.5 rad.* looks like degrees"),
        (lambda c: c["joint_rotations"].update(knee_l=[6.5, 0, 0]), "'knee_l' turns by 6.5 rad.* looks like degrees"),
        (lambda c: c.update(root_translation=[-26, -42, 912]), "913 m from the origin: it looks like mm"),
        (lambda c: c.update(root_translation=[-3, -4, 91]), "91 m from the origin: it looks like cm"),
        (lambda c: c.update(root_translation=[-3, -4, -91]), "91 m from the origin: it looks like cm"),
        (lambda c: c.update(root_translation=[-300, 0, 1]), "300 m from the origin: it looks like cm"),
        (lambda c: c.update(joint_rotation={}), "unknown key 'joint_rotation'\n.*did you mean 'joint_rotations'"),
        (lambda c: c.pop("root_translation"), "'root_translation' is missing"),
    ],
)
def test_bad_files(recording, scene, change, message):
    content = json.loads((recording / "init.json").read_text())
    change(content)
    (recording / "init.json").write_text(json.dumps(content))
    with pytest.raises(RecordingError, match=message):
        StartFromFile().run(open_recording(recording), scene)


def test_a_knee_that_bends_the_wrong_way_is_told(recording, scene, caplog):
    content = json.loads((recording / "init.json").read_text())
    for bend in (-0.35, -1.0):  # the former is a little beyond what knees can, as by eye
        assert not caplog.messages
        content["joint_rotations"]["knee_l"] = [bend, 0, 0]
        (recording / "init.json").write_text(json.dumps(content))
        StartFromFile().run(open_recording(recording), scene)
    (message,) = caplog.messages
    assert re.search(r"init.json bends joints as nobody can: knee_l.flexion -5\d° of -\d+° to 1\d\d°; are its", message)


def test_missing_file(recording, scene):
    (recording / "init.json").write_text("{")
    with pytest.raises(RecordingError, match="not JSON"):
        StartFromFile().need(open_recording(recording))  # before a run
    (recording / "init.json").unlink()
    with pytest.raises(RecordingError, match="the recording has: .*cameras.toml(.|\n)*start_from_keypoints"):
        StartFromFile().run(open_recording(recording), scene)


def test_a_later_part_has_a_file_of_its_own(recording, scene, caplog):
    later = open_recording(recording, start=12)
    assert StartFromFile().run(later, scene).pose.root[0, 3] == pytest.approx(
        StartFromFile().run(open_recording(recording), scene).pose.root[0, 3]
    )
    assert caplog.messages == ["init.json is taken for the pose of frame 12; init_000012.json would come before it"]
    content = json.loads((recording / "init.json").read_text())
    content["root_translation"][0] += 0.25
    (recording / "init_000012.json").write_text(json.dumps(content))
    whole = open_recording(recording)
    moved = StartFromFile().run(later, scene).pose.root - StartFromFile().run(whole, scene).pose.root
    assert moved[0, 3] == pytest.approx(0.25)
    assert recording / "init_000012.json" in StartFromFile().inputs(recording)


def test_starts_in_a_folder_of_their_own_are_inputs(recording):
    (recording / "starts").mkdir()
    for name in ("init.json", "init_000012.json"):
        shutil.copy(recording / "init.json", recording / "starts" / name)
    found = StartFromFile(file="starts/init.json").inputs(recording)
    assert [path.relative_to(recording).as_posix() for path in found] == ["starts/init.json", "starts/init_000012.json"]


def moved_to(recording, place):
    content = json.loads((recording / "init.json").read_text())
    (recording / "init.json").write_text(json.dumps(content | {"root_translation": place}))
    return content["root_translation"]


def test_a_pose_that_no_camera_sees_is_refused(recording, scene):
    moved_to(recording, [9.0, 9.0, 1.0])
    with pytest.raises(RecordingError, match="init.json  no camera sees the person at the first pose"):
        StartFromFile().run(open_recording(recording), scene)


def test_a_person_of_whom_nothing_but_the_feet_is_filmed_may_begin(recording, scene):
    """The root joint, and all within 0.6 m of it, lies above every picture."""
    x, y, _ = moved_to(recording, [0.0, 0.0, 1.0])
    place = next([x, y, z] for z in np.arange(1.0, 4.0, 0.05) if not seen(scene.cameras, [x, y, z - 0.6]))
    moved_to(recording, place)
    StartFromFile().run(open_recording(recording), scene)


def seen(cameras, point):
    pixels = [project(np.array([point]), camera)[0] for camera in cameras]
    return any((p >= 0).all() and (p < camera.size).all() for p, camera in zip(pixels, cameras, strict=True))
