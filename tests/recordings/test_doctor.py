"""The doctor finds each fault, says what to do, and finds nothing on a good recording."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from mocapflow_garments.shorts import Shorts

from mocapflow.geometry import twists
from mocapflow.geometry.cameras import magnification
from mocapflow.io.cameras import rigs
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.io.subject.first_pose import read_first_pose
from mocapflow.recordings.doctor import examine, examine_timing
from mocapflow.recordings.recording import open_recording
from tests.fixtures.recordings import avi_frames, look_at, ring, write_recording, write_reordered, write_video
from tests.io.cameras.test_calibration import write_easymocap

DEMO = Path(__file__).parents[2] / "examples" / "data"


LIMBS = (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist"))
CHAIN = {"pelvis": None} | {
    f"{name}_{side}": f"{limb[k - 1]}_{side}" if k else "pelvis"
    for side in "lr" for limb in LIMBS for k, name in enumerate(limb)
}  # fmt: skip


def position(name):
    height = 1.0 - 0.3 * next((limb.index(name[:-2]) for limb in LIMBS if name[:-2] in limb), 0)
    return [{"l": 0.05, "r": -0.05}.get(name[-1], 0.0), -0.05 if name.startswith("toe") else 0.0, height]


SHORTS = dict(
    type="shorts", waist_height=1.0, waist_circumference=0.9, hip_circumference=1.1, leg_opening_circumference=0.6,
    inseam=0.25, length=0.48,
)  # fmt: skip


@pytest.fixture
def good(tmp_path):
    """A good recording of a person of three boxes in shorts, to be damaged."""
    subject = write_recording(tmp_path, frames=3) / "subject"
    subject.mkdir()
    trunk, *legs = ((-0.13, 0.13), (0.8, 1.8)), ((-0.13, -0.03), (0.0, 0.8)), ((0.03, 0.13), (0.0, 0.8))
    corners = np.array([[x, y, z] for wide, high in (trunk, *legs) for x in wide for y in (-0.08, 0.08) for z in high])
    faces = np.array([[a + a % 2, a + (a + 1) % 2, a + 2] for box in (0, 8, 16) for a in range(box, box + 6)])
    rows = [f"v {x} {y} {z}\n" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces]
    (subject / "body.obj").write_text("".join(rows))
    joints = [{"name": name, "parent": parent, "position": position(name)} for name, parent in CHAIN.items()]
    (subject / "skeleton.json").write_text(json.dumps({"joints": joints}))
    movers = [f"{dict({0.0: 'toe', 0.8: 'knee', 1.8: 'shoulder'})[z]}_{'l' if x > 0 else 'r'}" for x, _, z in corners]
    weights = np.array([[float(name == mover) for name in CHAIN] for mover in movers])
    np.savez(subject / "weights.npz", weights=weights, names=list(CHAIN))
    (subject / "garment.json").write_text(json.dumps(SHORTS))
    pose = {"root_rotation": [0, 0, 0.1], "root_translation": [0, 0, 1], "joint_rotations": {"knee_l": [0.1, 0, 0]}}
    (tmp_path / "init.json").write_text(json.dumps(pose))
    plate = np.zeros((48, 64, 3), np.uint8)
    plate[:, 20:44] = 120  # where the person hides it
    for camera in ring():
        (tmp_path / "background").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "background" / f"{camera.name}.png"), plate)
    return tmp_path


def messages(folder, severity):
    return [finding.message for finding in examine(folder) if finding.severity == severity]


def errors(folder):
    return messages(folder, "error")


def edit(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
@pytest.mark.long
def test_the_demo_is_healthy(clip):
    assert [f for f in examine(DEMO / clip) if f.severity != "note"] == []


def test_a_good_recording_is_healthy(good):
    assert examine(good) == []


def test_no_first_pose_is_told_before_a_run_asks_for_it(good):
    (good / "init.json").unlink()
    assert messages(good, "note") == [
        "there is neither init.json nor keypoints/: silhouettes have to tell the pose of the first frame"
    ]
    shutil.rmtree(good / "background")
    (told,) = messages(good, "note")
    assert told.startswith("nothing tells the pose of the first frame") and "background/" in told
    (good / "keypoints").mkdir()
    assert messages(good, "note") == []


def test_several_faults_are_found_at_once_errors_first(good):
    (good / "subject" / "skeleton.json").unlink()
    (good / "videos" / "cam02.mp4").write_bytes(b"hello")
    edit(good / "subject" / "garment.json", lambda g: g.update(inseem=g.pop("inseam")))
    found = examine(good)
    assert [f.severity for f in found] == sorted((f.severity for f in found), key=["error", "warning", "note"].index)
    said = {f.message for f in found}
    assert said >= {"there is no skeleton for the mesh", "this video can't be decoded"}
    assert any(message.startswith("garment.inseem: unknown setting of shorts") for message in said)
    assert all(f.hint for f in found if f.severity == "error")


def test_nothing_there(tmp_path):
    assert errors(tmp_path / "nowhere") == ["no such recording folder"]
    assert errors(Path(__file__)) == ["this is a file; a recording is a folder"]
    assert errors(tmp_path) == ["no calibration file"]


def test_faces_that_look_both_ways(good):
    body = good / "subject" / "body.obj"
    body.write_text(body.read_text().replace("f 1 2 3\n", "f 2 1 3\n"))
    assert errors(good) == ["its faces look both inward and outward: at 2 % of the edges two disagree"]


@pytest.mark.parametrize("up", [-0.05, 0.05])
def test_a_scan_that_does_not_stand_on_the_floor(good, up):
    mesh, bones = good / "subject" / "body.obj", good / "subject" / "skeleton.json"
    lines = [line.split() for line in mesh.read_text().splitlines()]
    mesh.write_text("\n".join(" ".join([*k[:3], str(float(k[3]) + up)] if k[0] == "v" else k) for k in lines))
    edit(bones, lambda s: [j["position"].__setitem__(2, j["position"][2] + up) for j in s["joints"]])
    assert any(said.startswith(f"the scan begins at z = {up:.2f} m") for said in messages(good, "warning"))


@pytest.mark.parametrize(("lower", "told"), [(0.03, False), (0.1, True)])
def test_a_knee_that_is_out_of_place(good, lower, told):
    edit(good / "subject" / "skeleton.json", lambda s: s["joints"][2]["position"].__setitem__(2, 0.7 - lower))
    assert json.loads((good / "subject" / "skeleton.json").read_text())["joints"][2]["name"] == "knee_l"
    said = [text for text in messages(good, "warning") if "long on the left" in text]
    thigh = "the thigh is 0.40 m long on the left, 0.30 m on the right: are hip and knee of both sides at their places?"
    assert said[:1] == ([thigh] if told else [])


def test_a_scan_with_the_floor_in_it(good):
    (good / "subject" / "weights.npz").unlink()
    mesh = good / "subject" / "body.obj"
    mesh.write_text(mesh.read_text() + "v -0.6 -0.6 0\nv 0.6 -0.6 0\nv 0.6 0.6 0\nf -3 -2 -1\n")
    assert any(said.startswith("the scan reaches 0.8 m beside all bones") for said in messages(good, "warning"))


def test_mesh_without_skeleton(good):
    (good / "subject" / "skeleton.json").unlink()
    (finding,) = [f for f in examine(good) if f.severity == "error"]
    assert finding.message == "there is no skeleton for the mesh"
    assert finding.hint.startswith('expected {"joints": [{"name": "pelvis", "parent": null')
    assert finding.where == str(good / "subject" / "skeleton.json")


def test_lengths_in_mm(good):
    def grow(content):
        for joint in content["joints"]:
            joint["position"] = [1000 * x for x in joint["position"]]

    edit(good / "subject" / "skeleton.json", grow)
    edit(good / "subject" / "garment.json", lambda g: g.update(length=483))
    edit(good / "init.json", lambda pose: pose.update(root_translation=[0, 100, 900]))
    found = errors(good)
    assert any(m.startswith("15 of 15 joints lie more than 10 cm outside the mesh") for m in found)
    assert "garment.length: input should be less than 4, not 483" in found
    assert "the root joint is 906 m from the origin: it looks like mm" in found


def test_calibration_in_mm(tmp_path):
    write_recording(tmp_path, frames=2)
    cameras = [replace(c, camera_from_world=c.camera_from_world * [[1, 1, 1, 1000]]) for c in ring()]
    write_cameras(tmp_path / "cameras.toml", cameras)
    (finding,) = [f for f in examine(tmp_path) if f.severity == "error"]
    assert finding.message == "camera 'cam01' stands 4272 m from the origin: the calibration is in mm"
    assert finding.hint == "lengths are in metres: divide every translation by 1000"


def test_cameras_that_see_nothing_in_common(tmp_path):
    cameras = list(ring())
    cameras[1] = look_at("cam02", np.array([30.0, 30, 1.5]), target=(60, 60, 1.0))
    write_recording(tmp_path, frames=2, cameras=cameras)
    assert errors(tmp_path) == ["cam02: no other camera sees anything of what it sees"]


def test_no_point_seen_by_all(tmp_path):
    turns = np.radians([-40, 0, 40])  # each sees 56 degrees, so neighbours overlap and the outer two do not
    cameras = [
        look_at(f"cam0{i}", np.array([0.1 * i, 0, 1]), target=(9 * np.sin(t), 9 * np.cos(t), 1))
        for i, t in enumerate(turns)
    ]
    write_recording(tmp_path, frames=2, cameras=cameras)
    assert messages(tmp_path, "warning") == ["no point in space is seen by all cameras"]


def test_one_camera(tmp_path):
    write_recording(tmp_path, frames=2, cameras=ring(names=("cam01",)))
    assert messages(tmp_path, "warning") == ["there is one camera only"]


def turned(camera, rotation):
    """Return the camera in a world whose axes are turned."""
    motion = np.eye(4)
    motion[:3, :3] = rotation
    return replace(camera, camera_from_world=camera.camera_from_world @ motion.T)


def test_world_that_is_not_z_up(tmp_path):
    lie = twists.exp(np.array([-np.pi / 2, 0, 0, 0, 0, 0]))[:3, :3]  # z becomes y
    write_recording(tmp_path / "y", frames=2, cameras=[turned(c, lie) for c in ring()])
    assert "the images' up is the y axis of the world" in messages(tmp_path / "y", "warning")
    over = twists.exp(np.array([np.pi, 0, 0, 0, 0, 0]))[:3, :3]
    write_recording(tmp_path / "down", frames=2, cameras=[turned(c, over) for c in ring()])
    assert messages(tmp_path / "down", "warning") == [
        "the images' up is down in the world",
        "every camera is below the floor (heights -1.5 to -1.5 m)",
    ]


def test_cameras_that_face_each_other(tmp_path):
    pair = [look_at(n, np.array([x, 0.1, 1.5]), target=(0, 0, 1.5)) for n, x in (("cam01", 4.0), ("cam02", -4.0))]
    write_recording(tmp_path, frames=2, cameras=pair)
    assert any(m.startswith("cam01 and cam02 face each other (17") for m in messages(tmp_path, "note"))
    assert open_recording(tmp_path).warnings == ()


def test_missing_camera_and_unequal_lengths_and_sizes(tmp_path):
    write_recording(tmp_path / "a", frames=2)
    (tmp_path / "a" / "videos" / "cam02.mp4").unlink()
    assert errors(tmp_path / "a") == ["missing camera: no video of cam02"]
    write_recording(tmp_path / "b", frames=6, lengths={"cam03": 4})
    write_video(tmp_path / "b" / "videos" / "cam01.mp4", 6, (100, 48))
    assert errors(tmp_path / "b") == [
        "camera 'cam01': the video is 100 x 48 px, the calibration 64 x 48",
        "the videos differ in length",
    ]


def test_lost_frames_are_named(tmp_path):
    write_recording(tmp_path, frames=20, ending="avi", codec="MJPG")
    path = tmp_path / "videos" / "cam02.avi"
    content = bytearray(path.read_bytes())
    offset, length = avi_frames(content)[8]
    content[offset : offset + length] = bytes(length)
    path.write_bytes(content)
    assert messages(tmp_path, "warning") == ["cam02: frame 8 can't be decoded"]
    assert errors(tmp_path) == []


def test_frames_that_a_camera_left_out_are_not_called_damaged(tmp_path):
    write_recording(tmp_path, frames=20)
    write_reordered(tmp_path / "videos" / "cam02.mp4", 20, without=(13,))
    absent = [said for said in messages(tmp_path, "warning") if "missing in the video: its time stamps jump" in said]
    assert len(absent) == 1 and absent[0].startswith("cam02: frame")


def test_images_that_are_damaged_missing_or_of_another_size_are_named(tmp_path):
    write_recording(tmp_path, frames=8)
    folder, images = tmp_path / "videos" / "cam02", np.zeros((48, 64, 3), np.uint8)
    (tmp_path / "videos" / "cam02.mp4").unlink()
    folder.mkdir()
    for index in (0, 1, 2, 3, 5, 6, 7):
        cv2.imwrite(str(folder / f"{index:06}.png"), images if index != 6 else images[:40])
    (folder / "000002.png").write_bytes(b"no picture")
    assert "cam02: frames 2, 4, 6 missing, damaged or of another size" in messages(tmp_path, "warning")


def test_two_cameras_with_one_calibration(tmp_path):
    write_recording(tmp_path, frames=3)
    cameras = ring()
    write_cameras(tmp_path / "cameras.toml", [replace(cameras[1], name=cameras[0].name), *cameras[1:]])
    one, other = (camera.name for camera in cameras[:2])
    assert f"{one} and {other} stand in one place and look the same way" in errors(tmp_path)


def test_a_video_that_breaks_off(tmp_path):
    write_recording(tmp_path, frames=20, ending="avi", codec="MJPG")
    path = tmp_path / "videos" / "cam02.avi"
    content = path.read_bytes()
    path.write_bytes(content[: avi_frames(content)[11][0]])
    assert any(m.startswith("cam02: the video breaks off after frame 1") for m in messages(tmp_path, "warning"))


def test_bad_clean_plate(good):
    cv2.imwrite(str(good / "background" / "cam01.png"), np.zeros((40, 32, 3), np.uint8))
    assert errors(good) == ["this clean plate is 32 x 40 px, the video 64 x 48"]


def test_two_plates_of_a_camera_are_told_once(good):
    cv2.imwrite(str(good / "background" / "cam01.jpg"), np.zeros((48, 64, 3), np.uint8))
    assert errors(good) == ["2 clean plates of cam01: cam01.jpg, cam01.png"]


def test_a_plate_of_no_camera(good):
    (good / "background" / "cam01.png").rename(good / "background" / "cam1.png")
    assert errors(good) == ["no clean plate of cam01"]
    assert messages(good, "warning") == [
        "not used from background/: cam1.png; pictures are named after their cameras: cam01.png"
    ]


def test_keypoints_of_one_frame_twice(tmp_path):
    write_recording(tmp_path, frames=2)
    place = tmp_path / "keypoints" / "cam01_json"
    place.mkdir(parents=True)
    for frame in range(2):
        (place / f"{frame}_cam01.json").write_text('{"people": []}')
    assert errors(tmp_path) == ["two files for frame 1: 0_cam01.json, 1_cam01.json"]


def test_keypoints_with_nan(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in ("cam01", "cam02"):
        place = tmp_path / "keypoints" / f"{name}_json"
        place.mkdir(parents=True)
        for frame in range(2):
            x = float("nan") if (name, frame) == ("cam02", 1) else 1.0
            people = [{"pose_keypoints_2d": [x, 2.0, 0.5]}]
            (place / f"a.{frame}.json").write_text(json.dumps({"people": people}))
    assert messages(tmp_path, "warning") == [
        "cam02: keypoints of frame 1 are not all numbers (NaN): these points count as not seen",
        "cam03: no keypoints, though others have them",
    ]


def test_keypoints_of_no_camera(tmp_path):
    write_recording(tmp_path, frames=2)
    (tmp_path / "keypoints" / "camera1").mkdir(parents=True)
    assert messages(tmp_path, "warning") == [
        "not used from keypoints/: camera1; folders are named after their cameras: cam01_json"
    ]


def test_a_truth_that_can_not_be_read(good):
    (good / "truth").mkdir(exist_ok=True)
    (good / "truth" / "angles.csv").write_text("frame,knee_flexion_l\n0,abc\n")
    (finding,) = [finding for finding in examine(good) if finding.severity == "warning"]
    assert "`evaluate` does not begin" in finding.hint
    assert finding.message == "'abc' is no number" and finding.where.endswith("truth/angles.csv:2:2")


@pytest.mark.parametrize(
    ("change", "message", "hint"),
    [
        (
            lambda g: g.update(type="gown"),
            "garment: no garment named 'gown'",
            "available: cylinder, outfit, shorts, skirt",
        ),
        (lambda g: g.update(lengths=1), "garment.lengths: unknown setting of shorts", "did you mean 'length_m'"),
        (lambda g: g.pop("inseam"), "garment: shorts needs inseam_m", "measures, in metres, come from"),
        (lambda g: g.update(length=48), "garment.length: input should be less than 4, not 48", "measures, in metres"),
    ],
)
def test_garment(good, change, message, hint):
    edit(good / "subject" / "garment.json", change)
    (finding,) = examine(good)
    assert finding.severity == ("warning" if "gown" in message else "error")
    assert finding.message.startswith(message)
    assert finding.hint.startswith(hint)
    assert "garment.json" in finding.where


def test_a_garment_that_can_not_be_sewn(good):
    edit(good / "subject" / "garment.json", lambda g: g.update(waist_circumference=0.5))
    (finding,) = examine(good)
    assert finding.severity == "error" and "garment.json" in finding.where
    assert finding.message == "shorts: waist_circumference_m is 0.50 m, but the body measures 0.84 m there"


def test_a_garment_without_a_scan_is_tried_on_the_template(good):
    for scan in (good / "subject").glob("[!g]*"):
        scan.unlink()
    template = {"waist_height": 1.04, "waist_circumference": 0.88, "hip_circumference": 1.16, "inseam": 0.25,
                "leg_opening_circumference": 0.4, "length": 0.48}  # fmt: skip
    edit(good / "subject" / "garment.json", lambda g: g.update(template))  # tight, but for the template alone
    assert messages(good, "warning") == messages(good, "error") == []
    edit(good / "subject" / "garment.json", lambda g: g.update(waist_height=0.71, length=0.33, inseam=0.17))
    (finding,) = [finding for finding in examine(good) if finding.severity != "note"]
    assert finding.severity == "warning" and "garment.json" in finding.where
    assert finding.message == "on the template: shorts: at waist_height_m = 0.71 the legs have parted already"
    assert "body.height_m" in finding.hint


@pytest.mark.parametrize(
    ("problem", "said"), [(ZeroDivisionError("no strands"), "Zero.*: no strands"), (SystemExit(3), ".* status 3")]
)
def test_a_garment_that_raises_what_nobody_expects(good, monkeypatch, problem, said):
    def broken(self, body):
        raise problem

    monkeypatch.setattr(Shorts, "sew", broken)
    (finding,) = examine(good)
    assert finding.severity == "error" and re.fullmatch(f"shorts can't be sewn: {said}", finding.message)


def test_a_garment_that_a_run_would_refuse(good, monkeypatch):
    sew = Shorts.sew
    away = np.array([0, 0, 5.0])
    monkeypatch.setattr(Shorts, "sew", lambda self, body: replace(m := sew(self, body), vertices=m.vertices + away))
    (finding,) = examine(good)
    assert finding.severity == "error" and "garment.json" in finding.where
    assert finding.message.startswith("garment 'shorts' returned a pin 5")


def test_a_garment_that_is_mended(good):
    edit(good / "subject" / "garment.json", lambda g: g.update(leg_opening_circumference=0.45))
    (finding,) = examine(good)
    assert finding.severity == "warning" and finding.message.startswith("shorts: leg_opening_circumference_m")


@pytest.mark.parametrize(
    ("change", "message", "hint"),
    [
        (lambda p: p["joint_rotations"].update(kne_l=[0, 0, 0]),
         "the body has no joint 'kne_l'", "did you mean 'knee_l'?"),
        (lambda p: p.update(root_rotation=[0, 1]), "'root_rotation' is [0, 1]", "expected three finite numbers"),
        (lambda p: p.update(root_rotation=[0, 0, 10**400]), f"'root_rotation' is [0, 0, {10**400}]", "three finite"),
        (lambda p: p.pop("root_translation"), "'root_translation' is missing", 'expected {"root_rotation": [3]'),
        (lambda p: p.update(rotation=[0, 0, 0]), "unknown key 'rotation'", "did you mean 'root_rotation'?"),
    ],
)  # fmt: skip
def test_first_pose(good, change, message, hint):
    edit(good / "init.json", change)
    (finding,) = [f for f in examine(good) if f.severity == "error"]
    assert finding.message == message
    assert hint in finding.hint


def test_turns_that_may_be_in_degrees(good):
    edit(good / "init.json", lambda p: p["joint_rotations"].update(knee_l=[5.0, 0, 0], knee_r=[3.2, 0, 0]))
    assert messages(good, "warning")[0] == "'knee_l' turns by 5.0 rad, more than half around: is it in degrees?"
    assert not any("knee_r" in said for said in messages(good, "warning")) and errors(good) == []
    assert read_first_pose(good / "init.json", ()).turns["knee_l"].tolist() == [5.0, 0.0, 0.0]


def test_skeleton_and_weights_against_the_mesh(good):
    def move(content):
        content["joints"][0]["position"] = [2.0, 0, 1.0]

    edit(good / "subject" / "skeleton.json", move)
    assert errors(good) == ["1 of 15 joints lie more than 10 cm outside the mesh, first 'pelvis'"]
    edit(good / "subject" / "skeleton.json", lambda s: s["joints"][1].update(parent="pelvs"))
    (finding,) = [f for f in examine(good) if f.severity == "error"]
    assert finding.message == "parent 'pelvs' of joint 'hip_l' is not listed before it"
    assert "did you mean 'pelvis'?" in finding.hint


def test_joints_by_names_of_which_no_angle_is_known(good):
    (good / "init.json").unlink()
    (good / "subject" / "weights.npz").unlink()
    edit(good / "subject" / "skeleton.json", lambda s: s["joints"][-1].update(name="RightHand"))
    assert messages(good, "warning") == ["no angles elbow_r: the skeleton has no joints named wrist_r"]


def test_weights_of_another_mesh(good):
    path = good / "subject" / "weights.npz"
    with np.load(path) as content:
        weights, names = content["weights"], content["names"]
    np.savez(path, weights=weights[1:], names=names)
    assert errors(good)[0].startswith(
        f"the weights have the shape {weights[1:].shape}; expected ({len(weights)} vertices"
    )
    np.savez(path, weights=weights, names=[*names[:-1], "tail"])
    assert errors(good) == ["weights for 'tail', which is no joint of the skeleton"]
    np.savez(path, weights=weights[:, 2:], names=names[2:])
    assert errors(good) == [f"no weights for {names[0]}, {names[1]}"]
    path.write_bytes(b"nothing")
    assert errors(good) == ["this is no .npz file of numbers and names"]
    np.savez(path, weights=weights)  # without names: in the order of the skeleton
    assert errors(good) == []
    np.savez(path, weights=weights[:, ::-1])
    assert errors(good) == ["what 'knee_l' moves lies at 'pelvis'"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"late_frames": {"cam9": 3}}', "there is no camera 'cam9'"),
        ('{"late_frames": {"cam02": 100}}', "camera 'cam02' is 100 frames late in a recording of 3"),
        ("[]", "does not say how late the cameras are: "),
        ("{", "not JSON: "),
    ],
)
def test_recording_json(good, content, message):
    shutil.rmtree(good / "background")  # every frame is of another grey
    (good / "recording.json").write_text('{"late_frames": {"cam02": 1}}')
    assert examine(good) == []
    (good / "recording.json").write_text(content)
    (finding,) = examine(good)
    assert finding.severity == "error"
    assert finding.message.startswith(message)


def test_a_first_pose_that_cameras_do_not_see(good):
    cameras = list(ring())
    edit(good / "init.json", lambda pose: pose.update(root_translation=[0, 0, 9]))
    assert errors(good) == ["no camera sees the root joint of the first pose"]
    edit(good / "init.json", lambda pose: pose.update(root_translation=[0, 0, 1]))
    cameras[1] = look_at("cam02", np.array([4.0, 0, 1.5]), target=(4, 4, 1.0))
    write_cameras(good / "cameras.toml", cameras)
    assert "cam02 does not see the root joint of the first pose" in messages(good, "warning")


def test_cameras_whose_size_is_not_known_are_not_said_to_see_nothing(good):
    (good / "cameras.toml").unlink()
    write_easymocap(good, ring(), sizes=False)
    assert examine(good) == []  # the videos tell it
    (good / "videos" / "cam02.mp4").unlink()
    assert not messages(good, "warning") and len(errors(good)) == 1


def test_a_person_larger_in_the_images_than_is_of_use(good, monkeypatch):
    assert messages(good, "note") == []
    shown = [magnification(camera, np.array([0, 0, 1.0])) for camera in ring()]
    monkeypatch.setattr(rigs, "LARGE", np.median(shown) - 1)
    monkeypatch.setattr(rigs, "AMPLE", round(np.median(shown) / 2))
    (finding,) = examine(good)
    assert finding.message.startswith(f"the person is large in the images, {np.median(shown):.0f} px a metre")
    assert "scale: 0.5 in the pipeline" in finding.hint


def test_a_video_copied_twice(good):
    shutil.copy(good / "videos" / "cam01.mp4", good / "videos" / "cam03.mp4")
    assert messages(good, "warning") == ["cam01 and cam03 have the same video"]
    (finding,) = examine_timing(good, write=True)
    assert finding.message == "no lateness is measured: cam01 and cam03 have the same video"
    assert not (good / "recording.json").exists()


@pytest.mark.parametrize(
    ("first", "message"),
    [
        (0, "cam02 shows one picture from first to last, the others move"),
        (7, "cam02 repeats one picture from frame 7 on, the others move"),
    ],
)
def test_a_camera_that_hangs(tmp_path, first, message):
    write_recording(tmp_path, frames=20)
    write_video(tmp_path / "videos" / "cam02.mp4", 20, last=max(first - 1, 0))
    (finding,) = [finding for finding in examine(tmp_path) if finding.severity == "warning"]
    assert finding.message == message and finding.where.endswith("cam02.mp4")
    assert ("come into its view" in finding.hint) == (first > 0)


def test_a_first_pose_that_is_null(good):
    (good / "init.json").write_text("null")
    assert errors(good) == ["not a first pose"]


def test_not_json(good):
    (good / "init.json").write_text("{")
    (good / "subject" / "garment.json").write_text("[]")
    (good / "subject" / "skeleton.json").write_text('{"joints": [{}]}')
    found = errors(good)
    assert found[0] == "this is not a skeleton: KeyError('name')"
    assert found[1] == "not JSON: Expecting property name enclosed in double quotes"
    assert found[2] == "it does not say its type"


def test_the_static_trial_is_examined_too(tmp_path):
    write_recording(tmp_path, frames=3)
    write_recording(tmp_path / "static", frames=3, lengths={"cam02": 2})
    assert errors(tmp_path) == ["static trial: the videos differ in length"]
    assert not any("static trial" in said for said in messages(tmp_path, "note"))  # that there is none
    (tmp_path / "static" / "cameras.toml").write_text("")  # its own comes before that of the recording
    assert errors(tmp_path) == ["static trial: the file holds no camera"]
