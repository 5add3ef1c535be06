"""What the maker of takes of known motion poses, measures and sews, without Blender."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

import known_motion as made  # noqa: E402
from known_garments import ARM, measures_for, sew, together  # noqa: E402
from known_people import BUILDS, built, write_body  # noqa: E402
from known_takes import GREY, SLEEVES, Take  # noqa: E402

SKIRT, SHORTS = ROOT / "examples/data/skirt_steps", ROOT / "examples/data/shorts_steps"


def at_rest(body, turn=(0, 0, 0), translation=None):
    rotations = np.zeros((1, len(body.names), 3))
    rotations[0, 0] = turn
    return made.Motion((body.joints[0] if translation is None else translation)[None], rotations)


def lengths(points):
    return np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum()


@pytest.mark.parametrize("recording", [SKIRT, SHORTS], ids=lambda r: r.name)
def test_angles_of_the_true_joints_are_the_true_angles(recording):
    body, joints = made.read_body(recording / "subject"), np.load(recording / "truth/joints.npz")
    truth = np.genfromtxt(recording / "truth/angles.csv", delimiter=",", names=True)
    assert list(joints["names"]) == body.names
    angles = made.angles(body, joints["positions"].astype(float))
    assert ["frame", *angles] == list(truth.dtype.names)
    for name, column in angles.items():
        np.testing.assert_allclose(column, truth[name], atol=2e-3)


@pytest.mark.parametrize("recording", [SKIRT, SHORTS], ids=lambda r: r.name)
def test_the_pose_of_init_is_that_of_frame_0_with_its_errors(recording):
    body, init = made.read_body(recording / "subject"), json.loads((recording / "init.json").read_text())
    turns = [init["root_rotation"], *(init["joint_rotations"][name] for name in body.names[1:])]
    posed = made.chain(body, made.Motion(np.array([init["root_translation"]]), np.array([turns])))[1]
    truth = np.load(recording / "truth/joints.npz")["positions"][0]
    bones = np.linalg.norm(posed[0, 1:] - posed[0, body.parents[1:]], axis=1)
    np.testing.assert_allclose(bones, np.linalg.norm(truth[1:] - truth[body.parents[1:]], axis=1), atol=1e-4)
    ways = [(p[1:] - p[body.parents[1:]]) / bones[:, None] for p in (posed[0], truth)]
    assert 2 < np.degrees(np.arccos((ways[0] * ways[1]).sum(1))).mean() < 15  # errors add up along a limb
    assert 0.005 < np.linalg.norm(posed[0, 0] - truth[0]) < 0.1


def test_skinning_keeps_the_rest_body_and_turns_with_the_root():
    body = made.read_body(SKIRT / "subject")
    np.testing.assert_allclose(made.skin(body, at_rest(body))[0], body.vertices, atol=1e-6)
    turn, shift = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.2, 1.0])
    rigid = (body.vertices - body.joints[0]) @ Rotation.from_rotvec(turn).as_matrix().T + shift
    np.testing.assert_allclose(made.skin(body, at_rest(body, turn, shift))[0], rigid, atol=1e-6)


def test_bent_joints_show_in_the_signs_of_the_angles():
    body = made.read_body(SKIRT / "subject")
    motion = at_rest(body)
    motion.rotations[0, [body.names.index(n) for n in ("hip_l", "knee_l", "ankle_l")], 0] = np.radians([-50, 60, -20])
    bent = made.angles(body, made.chain(body, motion)[1])
    straight = made.angles(body, body.joints[None])
    for name, by in (("hip_flexion_l", 50), ("knee_flexion_l", 60), ("ankle_l", 20), ("knee_flexion_r", 0)):
        assert bent[name] - straight[name] == pytest.approx(by, abs=8)  # the centres are not quite in a plane


@pytest.mark.long
def test_scripted_motions_stand_on_the_floor():
    body = made.read_body(SKIRT / "subject")
    for script in made.SCRIPTS:
        take = Take("A", "skirt", script, 0, GREY, frames=60)  # a leg swings back late
        motion = made.ground(body, made.rotations_of(take, body, Path())[0])
        lowest = made.skin(body, motion, body.main("ankle", "toe"))[..., 2].min(1)
        assert np.abs(lowest).max() < 0.02
        knees = made.angles(body, made.chain(body, motion)[1])["knee_flexion_l"]
        assert np.ptp(knees) > 14  # least with the hands on the hips


def test_start_is_disturbed_by_four_degrees_and_the_same_each_time():
    body = made.read_body(SKIRT / "subject")
    one, again = (made.disturbed(body, at_rest(body), seed=3) for _ in range(2))
    assert one == again
    assert sorted(one["joint_rotations"]) == sorted(body.names[1:])
    assert 2 < np.degrees(np.std(list(one["joint_rotations"].values()))) < 6


@pytest.mark.long
@pytest.mark.parametrize("wearer", [SKIRT, SHORTS], ids=["hers", "his"])
def test_garments_have_their_measures(wearer):
    body = made.read_body(wearer / "subject")
    for owner, columns, rows in ((SKIRT, 72, 50), (SHORTS, 76, 17)):
        measures = json.loads((owner / "subject/garment.json").read_text())
        if owner != wearer:
            measures = measures_for(body, measures, made.read_body(owner / "subject"))
        garment = sew(body, measures)
        rings = garment.vertices[: rows * columns].reshape(rows, columns, 3)
        assert lengths(rings[0]) == pytest.approx(measures["waist_circumference"], rel=0.01)
        assert garment.quads.max() == len(garment.vertices) - 1
        along = np.linalg.norm(np.diff(rings, axis=0), axis=2).sum(0).mean()
        if owner is SKIRT:
            assert lengths(rings[-1]) == pytest.approx(measures["hem_circumference"], rel=0.01)
            assert along == pytest.approx(measures["length"], rel=0.01)
        else:
            hem = garment.vertices[-50:]
            assert lengths(hem) == pytest.approx(measures["leg_opening_circumference"], rel=0.02)
            assert along == pytest.approx(measures["length"] - measures["inseam"], rel=0.03)


@pytest.mark.parametrize(("wearer", "subject"), [(SKIRT, "A"), (SHORTS, "B")], ids=["hers", "his"])
def test_sleeves_have_their_measures_and_are_around_the_arms(wearer, subject):
    body, measures = made.read_body(wearer / "subject"), {"type": "cylinder", **SLEEVES[subject]}
    skin = made.o3d.t.geometry.RaycastingScene()
    skin.add_triangles(body.vertices.astype("f4"), body.faces.astype("u4"))
    for side in ("_l", "_r"):
        sleeve = sew(body, {**measures, "joint": "shoulder" + side})
        rings = sleeve.vertices.reshape(26, 40, 3)
        assert lengths(rings[0]) == pytest.approx(measures["upper_circumference"], rel=0.02)
        assert lengths(rings[-1]) == pytest.approx(measures["lower_circumference"], rel=0.02)
        along = np.linalg.norm(np.diff(rings, axis=0), axis=2).sum(0).mean()
        assert along == pytest.approx(measures["length"], rel=0.03)
        shoulder, elbow = body.joint("shoulder" + side), body.joint("elbow" + side)
        pinned = shoulder + measures["start"] * (elbow - shoulder)
        np.testing.assert_allclose(rings[0].mean(0), pinned, atol=0.02)
        assert skin.compute_signed_distance(sleeve.vertices.astype("f4")).numpy().min() > 0.002  # outside


def test_an_arm_that_comes_through_one_of_two_sleeves_is_told():
    body, measures = made.read_body(SKIRT / "subject"), {"type": "cylinder", **SLEEVES["A"]}
    both = together([sew(body, {**measures, "joint": joint}) for joint in ("shoulder_l", "shoulder_r")])
    half = len(both.vertices) // 2
    assert set(both.quads[len(both.quads) // 2 :].ravel()) == set(range(half, 2 * half))
    assert set(both.pinned) == {*range(80), *range(half, half + 80)}
    faces = np.concatenate([both.quads[:, [0, 1, 2]], both.quads[:, [0, 2, 3]]])
    assert not made.pierced(both.vertices, body.joints, faces, body.names, ARM)
    bent = at_rest(body)
    bent.rotations[0, body.names.index("elbow_l"), 0] = -np.pi / 2
    assert made.pierced(both.vertices, made.chain(body, bent)[1][0], faces, body.names, ARM)


@pytest.mark.long
def test_a_leg_that_comes_through_the_cloth_is_told():
    body = made.read_body(SKIRT / "subject")
    garment = sew(body, json.loads((SKIRT / "subject/garment.json").read_text()))
    quads, raised = garment.quads, at_rest(body)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    assert not made.pierced(garment.vertices, body.joints, faces, body.names)
    raised.rotations[0, body.names.index("hip_l"), 0] = -np.pi / 2
    assert made.pierced(garment.vertices, made.chain(body, raised)[1][0], faces, body.names)


@pytest.mark.parametrize("build", sorted(BUILDS))
def test_people_of_another_build_are_as_tall_and_stout_as_said(build, tmp_path):
    owner, wanted = SKIRT / "subject", BUILDS[build]
    body = made.read_body(owner)
    other = built(body, wanted)
    assert np.ptp(other.vertices[:, 2]) == pytest.approx(wanted.height_m, abs=1e-6)
    assert other.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    scale, longer = other.joints[:, 0].max() / body.joints[:, 0].max(), wanted.legs
    legs = other.joint("hip_l")[2] / body.joint("hip_l")[2] / scale
    assert legs == pytest.approx(longer, abs=1e-3)
    girths = [np.ptp(b.vertices[np.abs(b.vertices[:, 2] - b.joint("spine")[2]) < 0.02, 1]) for b in (body, other)]
    assert 0.5 < (girths[1] / scale - girths[0]) / (2 * wanted.laid_on_m / scale) < 1.2  # not all skin looks ahead
    write_body(other, owner, tmp_path)
    (tmp_path / "weights.npz").write_bytes((owner / "weights.npz").read_bytes())
    again = made.read_body(tmp_path)
    np.testing.assert_allclose(again.vertices, other.vertices, atol=1e-6)
    np.testing.assert_allclose(again.joints, other.joints, atol=1e-6)
    np.testing.assert_array_equal(again.faces, body.faces)
