"""Scaling a body: what each proportion does, and that keypoints give the proportions back."""

import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest
from keypoint_recording import DEMO, copy_demo, length, write
from mocapflow_bodies.template import Template
from mocapflow_fitting import fit_subject
from mocapflow_fitting.fit_subject import FitSubject
from mocapflow_fitting.keypoint_fit import Seen
from mocapflow_fitting.proportions import PROPORTIONS, fitted, modes_of, scaled
from mocapflow_fitting.start_from_file import read_pose

from mocapflow.data import Pose
from mocapflow.errors import RecordingError
from mocapflow.geometry import angles
from mocapflow.geometry.kinematics import chain, part_of, skin
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene

LIMBS = (("hip_l", "knee_l"), ("knee_r", "ankle_r"), ("shoulder_r", "elbow_r"), ("elbow_l", "wrist_l"))


def poses(body, count):
    first, rng = read_pose(DEMO / "init.json", body), np.random.default_rng(4)
    spread = np.where(np.isfinite(body.rest_spread), body.rest_spread, 0.4) * 0.4
    turns = rng.normal(size=(count, len(spread))) * spread
    return [Pose(root=first.root, angles=np.clip(first.angles + turn, *body.limits.T)) for turn in turns]


def test_template_is_a_person():
    woman, man = Template(shape=0.0).load(DEMO), Template(shape=1.0).load(DEMO)
    assert [round(float(np.ptp(b.vertices[:, 2])), 2) for b in (woman, man)] == [1.61, 1.74]
    np.testing.assert_allclose(np.ptp(Template(height_m=1.9).load(DEMO).vertices[:, 2]), 1.9, atol=1e-9)
    assert Template(part="legs").load(DEMO).cut.any()
    assert all(path.is_file() and path.stat().st_size < 1.5e6 for path in Template().inputs(DEMO))


@pytest.mark.parametrize("shape", [0.0, 1.0])
def test_joint_centres_of_the_template_are_those_of_people(shape):
    body = Template(shape=shape).load(DEMO)
    hip, knee, ankle = (body.positions[body.joint(name)] for name in ("hip_l", "knee_l", "ankle_l"))
    assert length(body, "hip_l", "hip_r") == pytest.approx(0.17, abs=0.02)
    assert length(body, "hip_l", "knee_l") == pytest.approx(length(body, "knee_l", "ankle_l"), rel=0.05)
    assert angles.three_point(np.stack([hip, knee, ankle])) < 6  # degrees: it stands with straight legs


def test_a_template_knows_how_people_differ():
    body = Template().load(DEMO)
    smaller, taller = (scaled(body, {"shape_0": sign}) for sign in (-1.0, 1.0))
    assert np.ptp(taller.vertices[:, 2]) - np.ptp(smaller.vertices[:, 2]) == pytest.approx(0.2, abs=0.05)
    others = [scaled(body, {name: 1.0}) for name in modes_of(body)[1:]]
    assert all(np.ptp(b.vertices[:, 2]) == pytest.approx(np.ptp(body.vertices[:, 2]), abs=0.04) for b in others)
    for other in (taller, *others):  # joints stay where the mesh has them: midway between what lies around them
        knee = np.abs(other.vertices - other.positions[other.joint("knee_l")]).max(axis=1) < 0.1
        assert 0 < other.positions[other.joint("knee_l")][0] - other.vertices[knee, 0].min() < 0.1
    assert not modes_of(taller) and not modes_of(Template(part="legs").load(DEMO))
    half = Template(height_m=np.ptp(body.vertices[:, 2]) / 2).load(DEMO)
    np.testing.assert_allclose(scaled(half, {"shape_0": 1.0}).vertices, taller.vertices / 2, atol=1e-9)


def test_a_shape_changes_before_proportions_and_alike_in_parts_of_the_body():
    body, factors = Template().load(DEMO), {"shape_1": 1.5, "shape_3": -2.0, "thigh": 1.1}
    some = np.arange(0, len(body.vertices), 7)
    whole, part = scaled(body, factors), scaled(part_of(body, some), factors)
    np.testing.assert_allclose(part.vertices, whole.vertices[some], atol=1e-12)
    np.testing.assert_allclose(part.twists, whole.twists, atol=1e-12)
    shaped = scaled(body, {"shape_1": 1.5, "shape_3": -2.0})
    expected = body.vertices + 1.5 * body.shape_modes[1] - 2.0 * body.shape_modes[3]
    np.testing.assert_allclose(shaped.vertices, expected, atol=1e-12)
    assert length(whole, "hip_l", "knee_l") == pytest.approx(1.1 * length(shaped, "hip_l", "knee_l"), rel=1e-9)


def test_no_change_without_factors(body):
    same = scaled(body, {})
    np.testing.assert_allclose(same.vertices, body.vertices, atol=1e-12)
    np.testing.assert_allclose(same.twists, body.twists, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "ends"),
    [("thigh", ("hip_l", "knee_l")), ("shank", ("knee_r", "ankle_r")), ("upper_arm", ("shoulder_l", "elbow_l")),
     ("forearm", ("elbow_r", "wrist_r")), ("hip_width", ("hip_l", "hip_r")),
     ("shoulder_width", ("shoulder_l", "shoulder_r")),
     ("foot", ("ankle_l", "toe_l")), ("stature", ("pelvis", "toe_r")), ("head", ("neck", "head"))],
)  # fmt: skip
def test_a_proportion_stretches_its_own_bones(body, name, ends):
    longer = scaled(body, {name: 1.1})
    assert length(longer, *ends) == pytest.approx(1.1 * length(body, *ends), rel=1e-9)
    if name != "stature":
        others = {"thigh": "knee_l", "shank": "hip_l", "hip_width": "knee_l"}.get(name, "hip_l")
        child = {"knee_l": "ankle_l", "hip_l": "knee_l"}[others]
        assert length(longer, others, child) == pytest.approx(length(body, others, child), rel=1e-9)
    normals = [
        np.cross(*np.moveaxis(b.vertices[b.faces[:, 1:]] - b.vertices[b.faces[:, :1]], 1, 0)) for b in (body, longer)
    ]
    area = np.linalg.norm(normals[0], axis=1)
    assert (np.sum(normals[0] * normals[1], axis=1) > 0)[area > 1e-7].mean() > 0.999  # no face turns over


def test_clavicles_are_of_the_shoulders(body):
    named = {"spine": "chest", "chest": "clavicle"}
    other = replace(body, joint_names=tuple(named.get(name, name) for name in body.joint_names))
    for name, wider in (("shoulder_width", 1.1), ("hip_width", 1.0)):
        apart = [length(each, "shoulder_l", "shoulder_r") for each in (scaled(other, {name: 1.1}), other)]
        assert apart[0] / apart[1] == pytest.approx(wider, rel=1e-9)


def test_girth_leaves_the_bones(body):
    slim = scaled(body, {"girth": 0.8})
    for ends in LIMBS:
        assert length(slim, *ends) == pytest.approx(length(body, *ends), rel=1e-9)
    thigh = (body.skin_joint[:, 0] == body.joint("hip_l")) & (body.skin_weight[:, 0] > 0.99)
    widths = [np.ptp(b.vertices[thigh, 0]) for b in (body, slim)]
    assert 0.75 < widths[1] / widths[0] < 0.9


def test_where_joints_turn_leaves_the_skin(body):
    """The template looks to -y; longer thighs carry the knees on from where the hips turn."""
    factors = {"hip_forward_m": 0.03, "knee_up_m": -0.02}
    other = scaled(body, factors)
    np.testing.assert_allclose(other.vertices, body.vertices, atol=1e-12)
    away = dict(zip(body.joint_names, other.positions - body.positions, strict=True))
    for side in "lr":
        np.testing.assert_allclose(away.pop(f"hip_{side}"), [0, -0.03, 0], atol=1e-12)
        np.testing.assert_allclose(away.pop(f"knee_{side}"), [0, 0, -0.02], atol=1e-12)
    np.testing.assert_allclose(list(away.values()), 0, atol=1e-12)
    of_hip = body.screw_joint == body.joint("hip_l")
    axes, points = other.twists[of_hip, :3], other.positions[body.joint("hip_l")]
    np.testing.assert_allclose(other.twists[of_hip, 3:], -np.cross(axes, points), atol=1e-12)
    longer = scaled(body, {**factors, "thigh": 1.1})
    assert length(longer, "hip_l", "knee_l") == pytest.approx(1.1 * length(other, "hip_l", "knee_l"), rel=1e-9)


def test_longer_legs_do_not_reach_below_the_floor(body):
    factors = {"thigh": 1.1, "shank": 1.05, "girth": 0.9}
    loose, stood = scaled(body, factors), fitted(body, factors)
    assert loose.vertices[:, 2].min() < -0.05
    assert stood.vertices[:, 2].min() == pytest.approx(body.vertices[:, 2].min(), abs=1e-12)
    up = stood.positions[0] - loose.positions[0]
    assert not up[:2].any()
    bent = np.linspace(-0.3, 0.3, len(body.twists))
    there = [skin(b, chain(b, Pose(root=np.eye(4), angles=bent))[0], bent) for b in (loose, stood)]
    np.testing.assert_allclose(there[1], there[0] + up, atol=1e-12)


def test_the_fitted_body_stands_on_the_floor(body, monkeypatch):
    monkeypatch.setattr(FitSubject, "need", lambda *_: None)
    monkeypatch.setattr(FitSubject, "_seen", lambda *_: [])
    monkeypatch.setattr(fit_subject, "fit", lambda *_: ({"stature": 1.1}, ()))
    found = FitSubject().run(open_recording(DEMO), Scene(cameras=(), body=body))
    assert np.ptp(found.vertices[:, 2]) == pytest.approx(1.1 * np.ptp(body.vertices[:, 2]))
    assert found.vertices[:, 2].min() == pytest.approx(body.vertices[:, 2].min(), abs=1e-12)


def test_which_trials_count_and_what_they_need(body, cameras, tmp_path, monkeypatch):
    folder, taken = copy_demo(tmp_path / "recording"), []
    static = copy_demo(folder / "static")
    with pytest.raises(RecordingError, match="static/keypoints  there are no 2D keypoints"):
        FitSubject(trial="static").need(open_recording(folder))
    write(static, body, poses(body, 1), cameras, bystander=())
    FitSubject(trial="static").need(open_recording(folder))  # those of the recording do not matter
    for trial, inputs in (("recording", []), ("auto", [static]), ("static", [static])):
        assert list(FitSubject(trial=trial).inputs(folder)) == inputs
    write(folder, body, poses(body, 1), cameras, bystander=())
    monkeypatch.setattr(fit_subject, "fit", lambda body, frames, *_: (taken.append(len(frames)), ({}, ()))[1])
    scene = Scene(cameras=cameras, body=body)
    for trial in ("recording", "auto", "static"):
        FitSubject(trial=trial).run(open_recording(folder, stop=1), scene)
    with pytest.raises(RecordingError, match="in the layout coco_17 17"):
        FitSubject(layout="coco_17").run(open_recording(folder, stop=1), scene)
    shutil.rmtree(static / "keypoints")
    FitSubject().run(open_recording(folder, stop=1), scene)
    assert taken == [1, 2, 1, 1]


def test_people_differ_by_the_limbs_that_both_trials_show():
    names, hip, knee, ankle = ("hip_l", "knee_l", "ankle_l"), [0.0, 0, 1], [0.0, 0, 0.5], [0.0, 0, 0.1]
    low, nowhere = [0.0, 0, 0.4], [np.nan] * 3

    def frame(*position):
        return Seen(position=np.array(position), pixels=np.zeros((1, 3, 2)), confidence=np.zeros((1, 3)))

    thigh, longer, shank = frame(hip, knee, nowhere), frame(hip, low, nowhere), frame(nowhere, knee, ankle)
    assert fit_subject.unlike([thigh], [longer], names) == pytest.approx(np.log(0.6 / 0.5))
    assert fit_subject.unlike([thigh], [shank], names) == 0


def test_unknown_proportions(body):
    with pytest.raises(ValueError, match="unknown proportions"):
        scaled(body, {"tigh": 1.0})
    assert "girth" in PROPORTIONS


@pytest.mark.long
def test_lengths_come_back_from_keypoints(body, cameras, tmp_path):
    person = scaled(body, {"stature": 1.06, "thigh": 1.05, "shank": 0.97, "upper_arm": 1.04, "trunk": 0.97})
    folder = copy_demo(tmp_path / "recording")
    write(folder, person, poses(person, 6), cameras, noise_px=0.3)
    recording = open_recording(folder, stop=6)
    fitted = FitSubject(frames=6).run(recording, Scene(cameras=cameras, body=body))
    for ends in LIMBS:
        before, after = (abs(length(b, *ends) - length(person, *ends)) for b in (body, fitted))
        assert after < 0.012 and after < 0.7 * before, ends  # m; the prior draws towards average proportions


@pytest.mark.long
def test_a_standing_trial_of_somebody_else_is_left_out(body, cameras, tmp_path, caplog):
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, poses(body, 3), cameras, noise_px=0.2)
    copy_demo(folder / "static")
    write(folder / "static", scaled(body, {"stature": 1.2}), poses(body, 2), cameras, noise_px=0.2, bystander=())
    scene = Scene(cameras=cameras, body=body)
    with caplog.at_level(logging.WARNING, "mocapflow"):
        alone = FitSubject(frames=3).run(open_recording(folder, stop=3), scene)
    assert "static/ is left out: its limbs differ by" in caplog.text
    assert length(alone, "hip_l", "knee_l") == pytest.approx(length(body, "hip_l", "knee_l"), rel=0.03)
    told = FitSubject(frames=3, trial="static").run(open_recording(folder, stop=3), scene)
    assert length(told, "hip_l", "knee_l") == pytest.approx(1.2 * length(body, "hip_l", "knee_l"), rel=0.05)
