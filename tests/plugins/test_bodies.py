"""T-BODY2: the three models and their files; the joint table; computed weights; clear errors."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from mocapflow_bodies.joints import TABLE, screws
from mocapflow_bodies.scanned import Morph, Scanned

from mocapflow.data import Pose
from mocapflow.errors import PipelineError, RecordingError
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.joints import angles_from_rotations
from mocapflow.geometry.skeleton import Skeleton, unsided
from mocapflow.io.subject.skeleton import read_skeleton

RECORDINGS = Path(__file__).parents[2] / "examples" / "data"


@pytest.fixture
def recording(tmp_path):
    shutil.copytree(RECORDINGS / "skirt_steps" / "subject", tmp_path / "subject")
    return tmp_path


@pytest.fixture(scope="module")
def body():
    return Scanned().load(RECORDINGS / "skirt_steps")


def start_angles(body, name="skirt_steps"):
    turns = json.loads((RECORDINGS / name / "init.json").read_text())["joint_rotations"]
    return angles_from_rotations(body, {n: np.array(v) for n, v in turns.items() if n in body.joint_names})


def posed(body, angles):
    joints, _ = kinematics.chain(body, Pose(root=np.eye(4), angles=angles))
    return kinematics.skin(body, joints, angles), kinematics.joint_positions(body, joints)


def test_files_are_kept_as_they_are(body):
    lines = (RECORDINGS / "skirt_steps" / "subject" / "body.obj").read_text().splitlines()
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    np.testing.assert_array_equal(body.vertices, vertices)
    with np.load(RECORDINGS / "skirt_steps" / "subject" / "weights.npz") as given:
        assert list(given["names"]) == list(body.joint_names)
        dense = np.zeros_like(given["weights"], dtype=float)
        np.add.at(dense, (np.arange(len(dense))[:, None], body.skin_joint), body.skin_weight)
        assert np.abs(dense - given["weights"]).max() < 0.02
    np.testing.assert_allclose(body.skin_weight.sum(axis=1), 1.0, atol=1e-12)
    assert body.skin_weight[body.skin_weight > 0].min() >= 0.01 and not body.cut.any()


def test_a_mesh_that_is_inside_out_is_turned(body, recording):
    mesh = recording / "subject" / "body.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices] + [f"f {c} {b} {a}" for a, b, c in body.faces + 1]
    mesh.write_text("\n".join(lines))
    np.testing.assert_array_equal(Scanned().load(recording).faces, body.faces)


def test_cache_key_covers_every_file(recording):
    names = {path.name for path in Scanned().inputs(recording)}
    assert names == {"body.obj", "skeleton.json", "weights.npz"}
    (recording / "subject" / "weights.npz").unlink()
    assert "weights.npz" not in {path.name for path in Scanned().inputs(recording)}


@pytest.mark.parametrize(("part", "joints", "screw_count"), [("full", 19, 48), ("legs", 10, 23), ("arms", 11, 28)])
def test_parts_move_as_the_whole_does(body, part, joints, screw_count):
    piece = Scanned(part=part).load(RECORDINGS / "skirt_steps")
    assert (len(piece.joint_names), len(piece.twists)) == (joints, screw_count)
    angles = {name: value for name, value in zip(body.screw_names, start_angles(body), strict=True)}
    kept = np.array([angles[name] for name in piece.screw_names])
    rest = np.array([angles[n] if n in piece.screw_names else 0.0 for n in body.screw_names])
    whole, piece_vertices = posed(body, rest)[0], posed(piece, kept)[0]
    match = {tuple(v): row for row, v in enumerate(body.vertices)}
    rows = [match[tuple(v)] for v in piece.vertices]
    np.testing.assert_allclose(piece_vertices, whole[rows], atol=5e-4)  # weights below 1 % are dropped anew
    if part != "full":
        rim = piece.vertices[piece.cut]
        height = body.positions[body.joint_names.index("chest" if part == "legs" else "pelvis"), 2]
        assert 20 < len(rim) < 200 and (np.abs(rim[:, 2] - height) < 0.15).all()


@pytest.mark.parametrize(("part", "names"), [
    ("legs", {"toe": "ball", "pelvis": "root"}), ("arms", {"wrist": "hand", "head": "skull", "pelvis": "root"}),
    ("legs", {"chest": "spine2"}),
])  # fmt: skip
def test_a_part_keeps_what_hangs_on_its_limbs_whatever_it_is_called(recording, part, names):
    whole = Scanned(part=part).load(recording)
    files = [recording / "subject" / name for name in ("skeleton.json", "weights.npz")]
    with np.load(files[1]) as given:
        weights, listed = given["weights"], given["names"]
    text = files[0].read_text()
    for old, new in names.items():
        text, listed = text.replace(f'"{old}', f'"{new}'), np.char.replace(listed, old, new)
    files[0].write_text(text)
    np.savez(files[1], weights=weights, names=listed)
    np.testing.assert_array_equal(Scanned(part=part).load(recording).vertices, whole.vertices)


def test_flexion_bends_the_way_people_do(body):
    forward, outward = np.array([0, -1.0, 0]), {"l": 1.0, "r": -1.0}
    for side in "lr":
        rest = posed(body, np.zeros(48))[1]

        def move(screw, joint, side=side, rest=rest):
            angles = np.zeros(48)
            angles[body.screw_names.index(screw.replace("*", side))] = 0.5
            joint = body.joint(joint.replace("*", side))
            return posed(body, angles)[1][joint] - rest[joint]

        assert move("hip_*.flexion", "knee_*") @ forward > 0.1
        assert move("hip_*.abduction", "knee_*")[0] * outward[side] > 0.1
        assert move("hip_*.rotation", "toe_*")[0] * outward[side] < -0.05
        assert move("knee_*.flexion", "ankle_*") @ forward < -0.1
        assert move("ankle_*.dorsiflexion", "toe_*")[2] > 0.03
        assert move("elbow_*.flexion", "wrist_*") @ forward > 0.05
        assert move("shoulder_*.raise", "elbow_*")[2] > 0.05
        assert move("shoulder_*.sweep", "elbow_*") @ forward > 0.05
        assert move("shoulder_*.sweep", "elbow_*")[0] * outward[side] < -0.02
    assert move("chest.flexion", "head") @ forward > 0.05


def test_sides_mirror_each_other(body):
    mirror = np.array([-1.0, 1, 1])
    for name in TABLE:
        if f"{name}_l" in body.joint_names:
            left, right = (body.twists[body.screw_joint == body.joint(f"{name}_{s}"), :3] for s in "lr")
            np.testing.assert_allclose(right, -left * mirror, atol=1e-9)  # axes are pseudo-vectors


def test_axes_turn_with_the_body(body):
    turned = twists.exp(np.array([0, 0, 2.0, 0, 0, 0]))[:3, :3]
    skeleton = Skeleton(body.joint_names, body.parents, body.positions @ turned.T)
    np.testing.assert_allclose(screws(skeleton).twists[:, :3], body.twists[:, :3] @ turned.T, atol=1e-12)


def test_limits_of_knee_and_elbow_count_from_the_straight_limb(body):
    for name, at_rest in (("knee_l", 9.5), ("elbow_l", 37.8)):
        screw = body.screw_names.index(f"{name}.flexion")
        low = TABLE[unsided(name)][0].low_deg
        assert np.degrees(body.limits[screw, 0]) == pytest.approx(low - at_rest, abs=0.2)


def test_an_unknown_joint_is_a_ball():
    skeleton = Skeleton(("root", "tail"), np.array([-1, 0], np.int32), np.array([[0, 0, 1.0], [0, 0.2, 1.0]]))
    chain = screws(skeleton)
    assert chain.names == ("tail.flexion", "tail.bend", "tail.twist")
    np.testing.assert_allclose(chain.twists[:, :3] @ chain.twists[:, :3].T, np.eye(3), atol=1e-12)
    assert np.isinf(chain.rest_spread).all()


def test_computed_weights_move_the_mesh_nearly_as_given_ones(body, recording):
    (recording / "subject" / "weights.npz").unlink()
    computed = Scanned().load(recording)
    for name in ("skirt_steps", "shorts_steps"):
        angles = start_angles(body, name)
        distance = np.linalg.norm(posed(body, angles)[0] - posed(computed, angles)[0], axis=1)
        assert np.sqrt((distance**2).mean()) < 0.007 and np.percentile(distance, 95) < 0.015


@pytest.mark.long
def test_morph_reads_the_second_shape(body, recording):
    shape = body.vertices + 0.01
    lines = [f"v {x} {y} {z}" for x, y, z in shape] + [f"f {a} {b} {c}" for a, b, c in body.faces + 1]
    (recording / "bent.obj").write_text("\n".join(lines))
    morph = Morph(mesh="bent.obj", angle="knee_l.flexion", from_deg=0, to_deg=90)
    morphing = Scanned(morph=morph, part="legs").load(recording)
    assert recording / "bent.obj" in Scanned(morph=morph).inputs(recording)
    angles = np.zeros(len(morphing.screw_names))
    angles[morphing.screw_names.index("knee_l.flexion")] = np.pi / 4
    np.testing.assert_allclose(morphing.morph_offset, 0.01, atol=1e-9)
    joints, _ = kinematics.chain(morphing, Pose(root=np.eye(4), angles=angles))
    pelvis = morphing.skin_weight[:, 0] == 1.0
    pelvis &= morphing.skin_joint[:, 0] == 0
    np.testing.assert_allclose(
        kinematics.skin(morphing, joints, angles)[pelvis], morphing.vertices[pelvis] + 0.005, atol=1e-9
    )
    with pytest.raises(PipelineError, match="no angle 'knee_l.flexoin'\n.*did you mean 'knee_l.flexion'"):
        Scanned(morph=morph.model_copy(update={"angle": "knee_l.flexoin"})).load(recording)
    (recording / "bent.obj").write_text("v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n")
    with pytest.raises(RecordingError, match="the second shape has 3 vertices, body.obj has 13348"):
        Scanned(morph=morph).load(recording)


def edit(path, change):
    content = json.loads(path.read_text())
    change(content["joints"])
    path.write_text(json.dumps(content))


def exchange_sides(joints):
    other = {"_l": "_r", "_r": "_l"}
    for joint in joints:
        for key in ("name", "parent"):
            end = (joint[key] or "")[-2:]
            joint[key] = joint[key] if end not in other else joint[key][:-2] + other[end]


def test_mesh_without_skeleton(recording):
    (recording / "subject" / "skeleton.json").unlink()
    with pytest.raises(RecordingError, match="skeleton.json  there is no skeleton for the mesh\n(.|\n)*unscanned.yaml"):
        Scanned().load(recording)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda joints: joints[3].update(parent="knee"), "parent 'knee' of joint 'ankle_l' is not listed before it"),
        (lambda joints: joints[3].update(name="knee_l"), "joint 'knee_l' is listed twice"),
        (lambda joints: joints[3].update(parent=None), "one joint must have no parent"),
        (lambda joints: joints[3].update(position=[0, float("nan"), 0]), "positions are not all numbers"),
        (lambda joints: joints[3].update(position=[0, 10**400, 0]), "this is not a skeleton: OverflowError"),
        (lambda joints: joints[3].pop("position"), "this is not a skeleton"),
        (
            lambda joints: joints[3].update(position=joints[2]["position"]),
            r"json:\d+:\d+  joints 'ankle_l' and 'knee_l' are in one place",
        ),
        (
            lambda joints: joints[1].update(position=[-0.103175, 0.00503, 0.95]),
            "joints 'hip_l' and 'hip_r' are in one place",
        ),
        (exchange_sides, "the toes point backwards: left and right are exchanged"),
        (
            lambda joints: joints[3].update(position=[0, 0, 5]),
            "1 of 19 joints lie .* outside the mesh, first 'ankle_l'",
        ),
    ],
)
def test_bad_skeletons(recording, change, message):
    edit(recording / "subject" / "skeleton.json", change)
    with pytest.raises(RecordingError, match=message):
        Scanned().load(recording)


def test_mesh_in_millimetres(recording, body):
    lines = [f"v {x} {y} {z}" for x, y, z in 1000 * body.vertices] + [f"f {a} {b} {c}" for a, b, c in body.faces + 1]
    (recording / "subject" / "body.obj").write_text("\n".join(lines))
    with pytest.raises(RecordingError, match="it seems to be in millimetres: divide by 1000"):
        Scanned().load(recording)


def test_weights_of_another_mesh(recording):
    np.savez(recording / "subject" / "weights.npz", weights=np.ones((5, 2)), names=np.array(["pelvis", "hip_l"]))
    with pytest.raises(RecordingError, match=r"shape \(5, 2\); expected \(13348 vertices, 2 joints\)"):
        Scanned().load(recording)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["pelvis", "hip_l", "hip_l"], "weights for 'hip_l' are there more than once"),
        ("pelvis", "this is no .npz file of numbers and names"),
    ],
)
def test_names_of_weights_that_name_no_columns(recording, names, message):
    np.savez(recording / "subject" / "weights.npz", weights=np.ones((13348, 3)), names=np.array(names))
    with pytest.raises(RecordingError, match=rf"weights\.npz  {message}\n"):
        Scanned().load(recording)


def test_weights_whose_description_is_damaged(recording):
    path = recording / "subject" / "weights.npz"
    np.savez(path, weights=np.ones((13348, 3)))
    path.write_bytes(path.read_bytes().replace(b"), }", b"), ("))
    with pytest.raises(RecordingError, match=r"weights\.npz  this is no .npz file of numbers and names\n"):
        Scanned().load(recording)


def test_weights_in_a_npy_by_another_name(recording):
    with (recording / "subject" / "weights.npz").open("wb") as file:
        np.save(file, np.ones((13348, 19)))
    with pytest.raises(RecordingError, match=r"weights\.npz  this is no .npz file of numbers and names\n"):
        Scanned().load(recording)


def test_a_missing_scan_says_what_else_there_is(tmp_path):
    with pytest.raises(RecordingError, match=r"body.obj  no such mesh\n.*unscanned.yaml"):
        Scanned().load(tmp_path)


def test_a_missing_second_shape_is_no_missing_scan(recording):
    morphing = Scanned(morph=Morph(mesh="bent.obj", angle="knee_l.flexion", from_deg=0, to_deg=90))
    with pytest.raises(RecordingError, match=r"bent.obj  no such mesh$"):
        morphing.need(recording)


def test_skeleton_is_read_parents_first():
    skeleton = read_skeleton(RECORDINGS / "shorts_steps" / "subject" / "skeleton.json")
    assert skeleton.parents[0] == -1 and (skeleton.parents[1:] < np.arange(1, len(skeleton.names))).all()
