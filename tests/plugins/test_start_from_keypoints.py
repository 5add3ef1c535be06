"""The first pose from keypoints: layouts, triangulation, choice of the person, inverse kinematics."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from keypoint_recording import DEMO, NAMES, bystander_of, copy_demo, keypoints, write
from mocapflow_bodies.template import Template
from mocapflow_fitting.detections import frames_seen, names_of, person_at, seen
from mocapflow_fitting.keypoint_layouts import LAYOUTS, layout_of
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.person import Person, find_person
from mocapflow_fitting.pose_fit import Solution, velocities
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_fitting.start_from_keypoints import StartFromKeypoints
from mocapflow_fitting.triangulate import Points, triangulate
from scipy.optimize import least_squares

from mocapflow.data import Pose
from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.cameras import project, projections
from mocapflow.model import moved
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene


@pytest.fixture(scope="module")
def body():
    return Template(shape=0.0).load(DEMO)


@pytest.fixture(scope="module")
def pose(body):
    return read_pose(DEMO / "init.json", body)


@pytest.fixture(scope="module")
def recording(tmp_path_factory, body, pose, cameras):
    folder = copy_demo(tmp_path_factory.mktemp("keypoints") / "recording")
    write(folder, body, [pose], cameras)
    return open_recording(folder)


def test_layouts_name_each_point_once():
    assert {name: len(points) for name, points in LAYOUTS.items()} == {
        "body_25": 25, "body_25b": 25, "halpe_26": 26, "coco_17": 17,
    }  # fmt: skip
    assert all(len(set(points)) == len(points) for points in LAYOUTS.values())


def test_body_25_and_25b_are_told_apart(body, pose, cameras):
    b = keypoints(body, pose, cameras[0], np.random.default_rng(0), 1.0)
    by_name = dict(zip(NAMES, b, strict=True))
    by_name["hip_mid"] = (by_name["hip_l"] + by_name["hip_r"]) / 2
    other = np.array([by_name[name] for name in LAYOUTS["body_25"]])
    assert layout_of([b]) == "body_25b" and layout_of([other]) == "body_25"
    for points, told in ((b, None), (other, "body_25")):  # of the former nobody knows the eyes
        hipless = np.where(np.arange(25)[:, None] == 12, 0.0, points)  # one of the points that both tell by
        assert layout_of([hipless]) == told
    assert layout_of([np.zeros((25, 3))]) is None
    assert layout_of([b[:17]]) == "coco_17"
    with pytest.raises(RecordingError, match="18 keypoints: the layout of the keypoints is not known"):
        layout_of([b[:18]])
    assert layout_of([np.zeros((25, 3))], "body_25b") == "body_25b"
    with pytest.raises(RecordingError, match="a person has 25 keypoints, in the layout coco_17 17"):
        layout_of([b[:17], b], "coco_17")
    with pytest.raises(RecordingError, match="no detections: the layout of the keypoints is not known"):
        layout_of([])


def test_triangulation_is_exact_and_outvotes_a_camera(cameras):
    points = np.random.default_rng(1).uniform((-0.5, -0.5, 0.2), (0.5, 0.5, 1.7), (12, 3))
    pixels, seen = np.stack([project(points, camera) for camera in cameras]), np.ones((4, 12))
    np.testing.assert_allclose(triangulate(pixels, seen, cameras).position, points, atol=1e-9)
    pixels[2] += (60.0, -40.0)
    found = triangulate(pixels, seen, cameras, scale_px=2.0)
    assert np.linalg.norm(found.position - points, axis=1).max() < 0.002
    assert np.median(found.error[2]) > 50
    seen[1:, 3] = 0.0
    assert np.isnan(triangulate(pixels, seen, cameras).position[3]).all()
    pixels[0, 5] = np.nan
    np.testing.assert_allclose(
        triangulate(pixels[[0, 1, 3]], seen[[0, 1, 3]], cameras[:2] + cameras[3:]).position[5], points[5]
    )


def test_what_two_cameras_can_not_place_is_nowhere(cameras):
    one, turned = cameras[0], np.diag([-1.0, 1, -1, 1]) @ cameras[1].camera_from_world  # it looks away
    away = replace(cameras[1], camera_from_world=turned)
    homogeneous = projections([one, away]) @ [0.1, 0.0, 1.0, 1.0]
    pixels = (homogeneous[:, :2] / homogeneous[:, 2:])[:, None]
    assert np.isnan(triangulate(pixels, np.ones((2, 1)), [one, away]).position).all()
    assert np.isnan(triangulate(pixels[[0, 0]], np.ones((2, 1)), [one, one]).position).all()


def test_the_person_is_who_reprojects_best(body, pose, cameras):
    rng = np.random.default_rng(2)
    detections = [[keypoints(body, pose, camera, rng, 1.0)] for camera in cameras]
    for c in (0, 1, 3):
        detections[c].insert(c % 2, keypoints(body, bystander_of(pose), cameras[c], rng, 1.0, 0.7))
    detections[2][0][4] = (5.0, 5.0, 0.9)  # one gross error
    person = find_person([np.array(people) for people in detections], cameras)
    expected = [people[row][:, :2] for people, row in zip(detections, (1, 0, 0, 0), strict=True)]
    np.testing.assert_array_equal(person.pixels, expected)
    with pytest.raises(RecordingError, match="cameras list 25 and 26 keypoints"):
        find_person([np.ones((1, 25, 3)), np.ones((1, 26, 3)), *(np.empty((0, 0, 3)),) * 2], cameras)
    assert find_person([np.array(detections[0]), *(np.empty((0, 0, 3)),) * 3], cameras) is None
    assert find_person([np.zeros((1, 25, 3))] * 4, cameras) is None  # as a detector lists whom it hardly sees


@pytest.mark.parametrize(("count", "usable"), [(7, False), (8, True)])
def test_a_frame_needs_eight_keypoints_that_two_cameras_see(body, pose, cameras, tmp_path, count, usable):
    rng, folder = np.random.default_rng(4), copy_demo(tmp_path / "recording")
    marked = [NAMES.index(name) for name in landmarks(body).names if name in NAMES]
    for camera in cameras[:2]:
        points = keypoints(body, pose, camera, rng, 0.5)
        points[marked[count:]] = 0
        person = {"pose_keypoints_2d": points.ravel().tolist()}
        path = folder / "keypoints" / f"{camera.name}_json" / f"{camera.name}.0000.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps({"people": [person]}))
    assert (person_at(open_recording(folder), 0, cameras) is not None) == usable


def test_keypoints_of_one_camera_or_of_a_layout_that_nothing_tells_are_refused(body, pose, cameras, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, [pose], cameras[:1], bystander=())
    with pytest.raises(RecordingError, match="there are no 2D keypoints of two cameras or more"):
        StartFromKeypoints().need(open_recording(folder))
    hardly = SimpleNamespace(folder=folder, people=lambda index: (np.zeros((1, 25, 3)),))
    with pytest.raises(RecordingError, match="25 keypoints may be BODY_25 or BODY_25B(.|\n)*setting `layout`"):
        names_of(hardly, [0], None)


def test_landmarks_that_a_layout_lacks_are_not_seen():
    points = Points(position=np.ones((1, 3)), error=np.zeros((2, 1)), weight=np.ones((2, 1)))
    person = Person(pixels=np.ones((2, 1, 2)), confidence=np.ones((2, 1)), points=points, support=2.0)
    found = seen(person, ("hip_l",), ("knee_l", "hip_l"))
    np.testing.assert_array_equal(found.position, [[np.nan] * 3, [1, 1, 1]])
    assert found.confidence.tolist() == [[0, 1], [0, 1]]


@pytest.mark.parametrize("lacking", ["hip_l", "neck", "head", "ankle_l"])
def test_a_body_has_the_landmarks_that_its_joints_and_its_skin_tell(body, lacking):
    other = replace(body, joint_names=tuple("x" if name == lacking else name for name in body.joint_names))
    found = landmarks(other)
    assert lacking not in found.names and ("nose" in found.names) == (lacking != "head")
    shoulder = found.body.vertices[found.names.index("shoulder_l")]
    raised = shoulder[2] - body.positions[body.joint("shoulder_l"), 2]
    assert (raised == 0) == (lacking in ("hip_l", "neck"))  # which say by how much
    few = landmarks(kinematics.part_of(other, np.arange(9))).names
    assert {"shoulder_l", "elbow_l"} <= set(few) and {"nose", "heel_r"}.isdisjoint(few)
    strange = tuple(f"joint {number}" for number in range(len(body.joint_names)))
    assert landmarks(replace(body, joint_names=strange)).names == ()


def test_landmarks_lie_where_their_names_say(body):
    marks = landmarks(body)
    at = dict(zip(marks.names, marks.body.vertices, strict=True))
    assert at["big_toe_l"][1] < at["ankle_l"][1] - 0.1 and at["heel_l"][1] > at["ankle_l"][1]
    assert at["small_toe_l"][0] > at["big_toe_l"][0] + 0.03 and at["big_toe_l"][2] < 0.06
    assert at["nose"][1] < at["ear_l"][1] - 0.05 and at["ear_l"][0] > 0.06 > -0.06 > at["ear_r"][0]
    assert at["head_top"][2] > body.vertices[:, 2].max() - 1e-9
    centre = {name: body.positions[body.joint(name)] for name in ("hip_l", "knee_l", "ankle_l", "shoulder_l")}
    assert at["hip_l"][0] > centre["hip_l"][0] + 0.01 and at["shoulder_l"][2] > centre["shoulder_l"][2] + 0.01
    assert all(np.array_equal(at[name], centre[name]) for name in ("knee_l", "ankle_l"))
    for name in ("big_toe", "heel", "small_toe", "hip"):
        np.testing.assert_allclose(at[f"{name}_r"], at[f"{name}_l"] * (-1, 1, 1), atol=0.005)


def test_landmarks_are_found_in_whatever_order_a_body_lists_the_joints_of_a_vertex(body):
    weight = np.ascontiguousarray(body.skin_weight[:, ::-1])  # the weakest first
    joint = np.where(weight > 0, body.skin_joint[:, ::-1], 0).astype(np.int32)
    expected, found = landmarks(body), landmarks(replace(body, skin_joint=joint, skin_weight=weight))
    assert found.names == expected.names
    np.testing.assert_array_equal(found.body.vertices, expected.body.vertices)


def test_a_heel_that_is_a_plane_has_a_place(body):
    """As that of a person who is put together from boxes: no vertex is farther back than most of them."""
    vertices = body.vertices.copy()
    low = vertices[:, 2] < body.positions[body.joint("ankle_l"), 2]
    plane = np.quantile(vertices[low, 1], 0.9)
    vertices[low, 1] = np.minimum(vertices[low, 1], plane)
    marks = landmarks(replace(body, vertices=vertices))
    length = plane - vertices[low, 1].min()
    assert marks.body.vertices[marks.names.index("heel_l"), 1] == pytest.approx(plane - 0.07 * length, abs=1e-3)


def test_derivatives_of_landmarks(body, pose):
    marks, spreads = landmarks(body), {"stature": 0.1, "thigh": 0.1, "trunk": 0.1}
    logs = np.array([0.05, -0.02, 0.03])
    points, moves = velocities(marks.body, pose, Solution(spreads, logs, ()))
    rng, step = np.random.default_rng(3), 1e-6
    for _ in range(5):
        shift = rng.normal(size=moves.shape[2])
        ends = [
            velocities(
                marks.body, moved(pose, s * step * shift[3:]), Solution(spreads, logs + s * step * shift[:3], ())
            )[0]
            for s in (1, -1)
        ]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), moves @ shift, atol=1e-6)
    assert np.isfinite(points).all()


def test_start_finds_the_pose(body, pose, recording):
    start = StartFromKeypoints().run(recording, Scene(cameras=recording.cameras, body=body))
    joints = [kinematics.joint_positions(body, kinematics.chain(body, p)[0]) for p in (pose, start.pose)]
    error = np.linalg.norm(joints[0] - joints[1], axis=1)
    assert np.median(error) < 0.01 and error.max() < 0.04  # m; one pixel is 12 mm
    knees = [body.screw_names.index(f"knee_{side}.flexion") for side in "lr"]
    assert np.degrees(np.abs(start.pose.angles - pose.angles)[knees]).max() < 4
    assert (start.pose.angles > body.limits[:, 0] - 0.02).all() and (start.pose.angles < body.limits[:, 1] + 0.02).all()


def test_a_layout_that_is_asked_for_is_taken(body, recording):
    with pytest.raises(RecordingError, match="in the layout coco_17 17"):
        StartFromKeypoints(layout="coco_17").run(recording, Scene(cameras=recording.cameras, body=body))


def test_a_turned_person_is_found_too(body, pose, cameras, tmp_path):
    turned = twists.exp(np.array([0, 0, 2.5, 0, 0, 0])) @ pose.root
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, [Pose(root=turned, angles=pose.angles)], cameras, bystander=())
    start = StartFromKeypoints().run(open_recording(folder), Scene(cameras=cameras, body=body))
    facing = np.degrees(np.linalg.norm(twists.log_rotation(start.pose.root[:3, :3].T @ turned[:3, :3])))
    assert facing < 8


def test_frames_without_people_are_passed_over_with_a_warning(body, pose, recording, tmp_path, caplog):
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, [pose, pose], recording.cameras)
    for path in folder.glob("keypoints/*/*.0000.json"):
        path.write_text(json.dumps({"people": []}))
    scene = Scene(cameras=recording.cameras, body=body)
    start = StartFromKeypoints().run(open_recording(folder), scene)
    assert np.linalg.norm(start.pose.root[:3, 3] - pose.root[:3, 3]) < 0.1
    assert caplog.messages == ["keypoints of frame 0 tell no pose: that of frame 1 is taken for it"]
    refused = "in frames 0 to 0 no two cameras see enough of the same person\n *they do in frame 1: .* --frames 1:\n"
    with pytest.raises(RecordingError, match=refused):
        StartFromKeypoints().run(open_recording(folder, stop=1), scene)
    for path in folder.glob("keypoints/*/*.0001.json"):
        path.write_text(json.dumps({"people": []}))
    with pytest.raises(RecordingError, match=r"the same person\n *check that"):  # there is no frame to begin at
        StartFromKeypoints().run(open_recording(folder, stop=2), scene)


@pytest.mark.long
def test_frames_that_show_nothing_of_what_the_body_has_are_passed_over(body, pose, recording, tmp_path):
    """Legs, of a person whose legs are behind a table in the first frame."""
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, [pose, pose], recording.cameras)
    below = [NAMES.index(name) for name in landmarks(Template(part="legs").load(DEMO)).names]
    for path in folder.glob("keypoints/*/*.0000.json"):
        people = [np.reshape(person["pose_keypoints_2d"], (-1, 3)) for person in json.loads(path.read_text())["people"]]
        for person in people:
            person[below] = 0.0
        path.write_text(json.dumps({"people": [{"pose_keypoints_2d": person.ravel().tolist()} for person in people]}))
    whole, legs = (Scene(cameras=recording.cameras, body=Template(part=part).load(DEMO)) for part in ("full", "legs"))
    first, both = (open_recording(folder, stop=stop) for stop in (1, 2))
    stage, names = StartFromKeypoints(layout="body_25b"), landmarks(legs.body).names
    start = stage.run(both, legs)
    assert np.linalg.norm(start.pose.root[:3, 3] - pose.root[:3, 3]) < 0.1
    assert np.isfinite(stage.run(first, whole).pose.root).all()
    with pytest.raises(RecordingError, match="no two cameras see enough of the same person"):
        stage.run(first, legs)
    assert list(frames_seen(both, [0, 1], legs.cameras, names, "body_25b")) == [1]
    with pytest.raises(RecordingError, match="keypoints show too little of the body\n(.|\n)*the body has hip_l"):
        frames_seen(first, [0], legs.cameras, names, "body_25b")


def test_no_keypoints(body, cameras):
    with pytest.raises(RecordingError, match="no 2D keypoints(.|\n)*the recording has: .*videos(.|\n)*start_from_file"):
        StartFromKeypoints().run(open_recording(DEMO), Scene(cameras=cameras, body=body))


def test_a_camera_that_contradicts_the_others_is_trusted_by_cauchys_rule():
    cameras, place = open_recording(DEMO).cameras, np.array([[0.1, 0.0, 1.0]])
    pixels = np.stack([project(place, camera) for camera in cameras])
    pixels[0] += [0.0, 40.0]
    found = triangulate(pixels, np.ones((len(cameras), 1)), cameras, scale_px=8.0, rounds=50)
    assert np.linalg.norm(found.position - place) < 0.01
    assert found.error[0, 0] > 30
    np.testing.assert_allclose(found.weight, 1 / (1 + (found.error / 8.0) ** 2), rtol=1e-6)


def test_points_are_where_they_miss_the_images_least():
    """Of cameras near and far: an error in metres is worth the fewer pixels the farther the camera is."""
    cameras, place = list(open_recording(DEMO).cameras), np.array([[0.1, 0.0, 1.0]])
    for index, metres in ((1, 6.0), (3, 15.0)):
        back = np.eye(4)
        back[2, 3] = metres
        cameras[index] = replace(cameras[index], camera_from_world=back @ cameras[index].camera_from_world)
    noise = np.random.default_rng(5).normal(scale=3.0, size=(len(cameras), 1, 2))
    pixels = np.stack([project(place, camera) for camera in cameras]) + noise

    def off(at):
        return np.concatenate(
            [project(at[None], camera)[0] - seen[0] for camera, seen in zip(cameras, pixels, strict=True)]
        )

    found = triangulate(pixels, np.ones((len(cameras), 1)), cameras, scale_px=1e4).position[0]
    best = least_squares(off, place[0]).x
    assert np.linalg.norm(found - best) < 2e-4 < 0.1 * np.linalg.norm(best - place[0])
