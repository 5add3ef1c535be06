"""Training poses: one motion comes out the same from every kind of file."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_bodies.template import Template
from mocapflow_export import tables
from mocapflow_export.formats import Result, write
from mocapflow_priors import training, training_bvh
from mocapflow_priors.density import read
from results_scene import DEMO, demo_scene, stepping
from typer.testing import CliRunner

from mocapflow.assets import Body
from mocapflow.cli import app
from mocapflow.errors import PipelineError, RecordingError
from mocapflow.geometry import angles
from mocapflow.io.motion import opensim
from mocapflow.io.motion.mot import write_mot
from mocapflow.recordings.recording import open_recording
from tests.fixtures.turns import rotations_from_angles

BENT = {"hip_l.flexion": 40.0, "knee_l.flexion": 70.0, "ankle_l.dorsiflexion": 12.0, "elbow_l.flexion": 50.0}
BVH = """HIERARCHY
ROOT Hips
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {{
    OFFSET 0 10 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {{
      OFFSET 0 10 0
    }}
  }}
{legs}
}}
MOTION
Frames: 1
Frame Time: 0.0333
{values}
"""
LEG = """  JOINT {side}UpLeg
  {{
    OFFSET {x} 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT {side}Leg
    {{
      OFFSET 0 -40 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT {side}Foot
      {{
        OFFSET 0 -40 0
        CHANNELS 3 Zrotation Xrotation Yrotation
        JOINT {side}ToeBase
        {{
          OFFSET 0 0 15
          CHANNELS 3 Zrotation Xrotation Yrotation
          End Site
          {{
            OFFSET 0 0 5
          }}
        }}
      }}
    }}
  }}"""


@pytest.fixture(scope="module")
def body() -> Body:
    return Template().load(Path())


@pytest.fixture(scope="module")
def motion(body: Body) -> np.ndarray:
    poses = np.zeros((12, len(body.twists)))
    for name, degrees in BENT.items():
        poses[:, body.screw_names.index(name)] = np.radians(np.linspace(0.3, 1, 12) * degrees)
    return poses


def assert_same(found: training.Angles, motion: np.ndarray, body: Body, atol_deg: float = 1e-4) -> None:
    assert set(BENT) <= set(found)
    for name in BENT:
        expected = np.degrees(motion[:, body.screw_names.index(name)])
        np.testing.assert_allclose(np.degrees(found[name]), expected, atol=atol_deg, err_msg=name)


def test_joint_rotations(body: Body, motion: np.ndarray, tmp_path: Path) -> None:
    turns = [rotations_from_angles(body, pose) for pose in motion]
    names = [name for name in turns[0] if name != "elbow_r"]  # the body's, but for one, and one that it lacks
    vectors = np.array([[*(turn[name] for name in names), [0.1, 0.2, 0.3]] for turn in turns])
    np.savez(tmp_path / "take.npz", rotation_vectors=vectors, joint_names=np.array([*names, "tail"]))
    found = training.read_angles(tmp_path / "take.npz", body)
    assert_same(found, motion, body)
    assert {name.partition(".")[0] for name in found} == set(names) & {n.partition(".")[0] for n in body.screw_names}


def test_a_table_of_angles(body: Body, motion: np.ndarray, tmp_path: Path) -> None:
    series = angles.measure(body, np.tile(np.eye(4), (12, 1, 1)), motion)
    columns = {name: series.value[:, k] for k, name in enumerate(series.names)}
    tables.write_columns(tmp_path / "angles.csv", columns)
    found = training.read_angles(tmp_path / "angles.csv", body)
    assert_same(
        found, motion, body, atol_deg=1.5
    )  # a hinge that is not quite square to the limb, and hip against thigh


def test_a_table_in_radians(body: Body, tmp_path: Path) -> None:
    tables.write_columns(tmp_path / "angles.csv", {"knee_flexion_l": np.radians(np.linspace(5, 90, 9))})
    with pytest.raises(RecordingError, match=r"^\S+angles\.csv  no angle in it is above 3\.14: .* in radians"):
        training.read_angles(tmp_path / "angles.csv", body)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("knee_flexion_l,knee_flexion_r\n0,9,7,8\n", "angles.csv:2  4 columns; expected 2"),
        ("knee_flexion_l;knee_flexion_r\n9;7\n", "divided by semicolons"),
        ("knee_flexion_l,knee_flexion_l\n9,7\n", "two columns are called"),
    ],
    ids=["decimal commas", "semicolons", "twice"],
)
def test_a_table_that_can_be_misread_is_refused(tmp_path, body, text, message):
    (tmp_path / "angles.csv").write_text(text)
    with pytest.raises(RecordingError, match=message):
        training.read_angles(tmp_path / "angles.csv", body)


@pytest.mark.parametrize("value", [np.inf, -np.inf, 400.0])
@pytest.mark.parametrize("file", ["angles.csv", "angles.mot"])
def test_an_angle_that_no_joint_has(body: Body, tmp_path: Path, file: str, value: float) -> None:
    bend = np.array([10.0, np.nan, value, 40.0])
    tables.write_columns(tmp_path / "angles.csv", {"knee_flexion_l": bend})
    write_mot(tmp_path / "angles.mot", {"knee_angle_l": bend}, np.arange(4) / 30)
    with pytest.raises(RecordingError, match=rf"{file}  knee_(flexion|angle)_l is {value:g} in row 3\n"):
        training.read_angles(tmp_path / file, body)


def test_an_opensim_motion(body: Body, motion: np.ndarray, tmp_path: Path) -> None:
    columns = opensim.coordinates(body, np.tile(np.eye(4), (12, 1, 1)), motion)
    write_mot(tmp_path / "angles.mot", columns, np.arange(12) / 30)
    assert_same(training.read_angles(tmp_path / "angles.mot", body), motion, body, atol_deg=2.5)
    joints, screws = (tuple(n.replace("elbow", "x") for n in names) for names in (body.joint_names, body.screw_names))
    legs = training.read_angles(tmp_path / "angles.mot", replace(body, joint_names=joints, screw_names=screws))
    assert "knee_l.flexion" in legs and not any(name.startswith("elbow") for name in legs)


def test_an_opensim_motion_of_a_model_that_counts_knees_the_other_way(body: Body, tmp_path: Path) -> None:
    """As gait2392 does; a knee that is stretched too far now and then is none."""
    bend = np.linspace(-2, 60, 12)
    write_mot(tmp_path / "ours.mot", {"knee_angle_r": bend, "knee_angle_l": bend - 10}, np.arange(12) / 30)
    assert set(training.read_angles(tmp_path / "ours.mot", body)) == {"knee_r.flexion", "knee_l.flexion"}
    unseen = np.where(np.arange(12) < 9, np.nan, -bend)
    for name, values in (("other", -bend), ("gaps", unseen)):
        columns = {"knee_angle_r": bend, "knee_angle_l": values}
        write_mot(tmp_path / f"{name}.mot", columns, np.arange(12) / 30)
        with pytest.raises(RecordingError, match=rf"{name}\.mot  knee_angle_l bends backwards: its model counts"):
            training.read_angles(tmp_path / f"{name}.mot", body)


def test_a_hip_of_a_body_whose_thighs_point_ahead_at_rest(body: Body) -> None:
    """By 14 degrees: bent by 170 a thigh would point past straight up, which is shown as -176."""
    positions = body.positions.copy()
    knee, hip = body.joint("knee_l"), body.joint("hip_l")
    positions[knee, 1] -= 0.25 * (positions[hip, 2] - positions[knee, 2])
    ahead = replace(body, positions=positions)
    poses = np.zeros((9, len(body.twists)))
    poses[:, body.screw_names.index("hip_l.flexion")] = bends = np.radians(np.linspace(-30, 120, 9))
    series = angles.measure(ahead, np.tile(np.eye(4), (9, 1, 1)), poses)
    shown = {"hip_flexion_l": series.value[:, series.names.index("hip_flexion_l")]}
    assert shown["hip_flexion_l"][-1] > 130
    np.testing.assert_allclose(training.from_columns(shown, ahead)["hip_l.flexion"], bends, atol=1e-3)


def test_a_thigh_past_straight_up_is_bent_as_far_as_can_be_and_not_stretched(body: Body) -> None:
    """Raised aside, above the level: nobody stretches a hip by 60 degrees, the least that is looked up."""
    degrees = np.array([160.0, 179.0, -179.0, -160.0, -30.0])
    bends = np.degrees(training.from_columns({"hip_flexion_l": degrees}, body)["hip_l.flexion"])
    assert (bends[:4] > 150).all() and bends[4] == pytest.approx(-30, abs=5)


def test_a_bvh_motion(tmp_path: Path) -> None:
    pytest.importorskip("bvhio")
    legs = "\n".join(LEG.format(side=side, x=x) for side, x in (("Left", 10), ("Right", -10)))
    values = "0 0 0 0 0 0  0 0 0  0 -30 0  0 70 0  0 -15 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0"
    (tmp_path / "take.bvh").write_text(BVH.format(legs=legs, values=values))
    found = training_bvh.columns(tmp_path / "take.bvh")
    expected = {"hip_flexion_l": 30, "knee_flexion_l": 70, "ankle_l": 15, "hip_flexion_r": 0, "knee_flexion_r": 0}
    for name, degrees in expected.items():
        assert found[name] == pytest.approx([degrees], abs=1e-3), name
    (tmp_path / "legs.bvh").write_text(BVH.format(legs=legs, values=values).replace("Spine", "Tail"))
    legs_only = training_bvh.columns(tmp_path / "legs.bvh")
    assert "knee_flexion_l" in legs_only and "hip_flexion_l" not in legs_only  # nothing tells how the pelvis stands


def test_joints_of_other_files_are_known_by_their_names() -> None:
    names = ["mixamorig:LeftUpLeg", "Right Up_Leg", "rtibia", "LTibia", "Hips", "toe_r"]
    assert training_bvh.our_names(names) == {"hip_l": 0, "hip_r": 1, "knee_r": 2, "knee_l": 3, "toe_r": 5}


def test_without_the_reader_of_bvh_files_it_says_what_to_install(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "bvhio", None)
    with pytest.raises(RecordingError, match=r"take\.bvh  BVH files need the package bvhio\n.*mocapflow\[bvh\]"):
        training_bvh.columns(tmp_path / "take.bvh")


def test_our_own_bvh(tmp_path: Path) -> None:
    pytest.importorskip("bvhio")
    scene = demo_scene()
    track = stepping(scene.body, 12)
    path = write("bvh", Result(track=track, scene=scene, recording=open_recording(DEMO)), tmp_path)
    found, series = training_bvh.columns(path), angles.measure(scene.body, track.root, track.angles)
    joints = ("hip_flexion", "knee_flexion", "ankle", "elbow")
    for name in (f"{joint}_{side}" for joint in joints for side in ("l", "r")):
        np.testing.assert_allclose(found[name], series.value[:, series.names.index(name)], atol=1e-3, err_msg=name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("HIERARCHY\nROOT hips\n{", "its joints or its motion are cut off"),
        ("HIERARCHY\nROOT hips\n{\n}\nMOTION\nFrames: 2\nFrame Time: 0.1\n0 0 0\n", "1 of 2 frames are there"),
    ],
)
def test_a_bvh_that_is_cut_off(tmp_path: Path, text: str, message: str) -> None:
    pytest.importorskip("bvhio")
    (tmp_path / "take.bvh").write_text(text)
    with pytest.raises(RecordingError, match=rf"take\.bvh  no whole BVH file: {message}"):
        training_bvh.columns(tmp_path / "take.bvh")


def test_files_of_another_kind(body: Body, tmp_path: Path) -> None:
    pytest.importorskip("bvhio")
    (tmp_path / "take.bvh").write_text("ROOT hips\n{\n}\nMOTION\nFrames: 0\nFrame Time: 0.1\n")
    with (tmp_path / "take.npz").open("wb") as file:
        np.save(file, np.ones(3))
    np.savez(tmp_path / "headless.npz", joint_names=np.array(["knee_l"]))
    broken = (tmp_path / "headless.npz").read_bytes().replace(b"}", b" ")
    (tmp_path / "headless.npz").write_bytes(broken)
    told = r"cannot be read as \.(bvh|npz): .*\n.*damaged, or of another kind"
    for name in ("take.bvh", "take.npz", "headless.npz"):
        with pytest.raises(RecordingError, match=f"{name}  {told}"):
            training.read_angles(tmp_path / name, body)


def test_the_command(body: Body, motion: np.ndarray, tmp_path: Path) -> None:
    columns = opensim.coordinates(body, np.tile(np.eye(4), (12, 1, 1)), motion)
    write_mot(tmp_path / "take.mot", columns, np.arange(12) / 30)
    out = tmp_path / "poses.npz"
    command = ["prior", "fit", str(tmp_path / "take.mot"), "--out", str(out), "--angle", "knee.flexion"]
    said = CliRunner().invoke(app, command)
    assert said.exit_code == 0, said.output
    assert "12 poses" in said.output
    assert read(out).names == ("knee_l.flexion", "knee_r.flexion")


@pytest.mark.parametrize("out", ["take.npz", "take.csv"])
def test_what_is_learned_is_not_written_over_a_recording(tmp_path: Path, out: str) -> None:
    (tmp_path / "take.npz").write_bytes(b"mine")
    said = CliRunner().invoke(app, ["prior", "fit", str(tmp_path / "take.npz"), "--out", str(tmp_path / out)])
    assert said.exit_code != 0 and (tmp_path / "take.npz").read_bytes() == b"mine"
    assert isinstance(said.exception, PipelineError) or "a .npz that is none of FILES" in said.output


@pytest.mark.parametrize("wanted", ["knee_l.flexion", "knee_l"])
def test_an_angle_of_one_side(body: Body, tmp_path: Path, wanted: str) -> None:
    (tmp_path / "knees.csv").write_text("frame,knee_flexion_l,knee_flexion_r\n0,10,9\n1,20,8\n")
    assert training.fit([tmp_path / "knees.csv"], body, [wanted]).names == ("knee_l.flexion",)


def test_what_is_learned_is_what_all_files_have_in_frames_that_are_known(body: Body, tmp_path: Path) -> None:
    (tmp_path / "legs.csv").write_text("knee_flexion_l,ankle_l\n10,1\nnan,2\n30,3\n")
    (tmp_path / "knee.csv").write_text("knee_flexion_l\n60\n20\n")
    found, closer = (
        training.fit([tmp_path / "legs.csv", tmp_path / "knee.csv"], body, percentile=share) for share in (100, 0)
    )
    assert found.names == ("knee_l.flexion",) and 0 < closer.bandwidth < 0.5 * found.bandwidth
    np.testing.assert_allclose(np.degrees(found.poses[:, 0]), [10, 20, 30, 60], atol=3)


def test_one_pose_is_no_density(body: Body, tmp_path: Path) -> None:
    (tmp_path / "still.csv").write_text("knee_flexion_l\n10\n10\nnan\n")
    with pytest.raises(RecordingError, match=r"still\.csv  a density needs two different poses"):
        training.fit([tmp_path / "still.csv"], body)


@pytest.mark.long
def test_errors(body: Body, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no kind of file with joint angles\n.*known: \.bvh, \.csv, \.mot, \.npz"):
        training.read_angles(tmp_path / "take.txt", body)
    with pytest.raises(RecordingError, match=r"there is no such file"):
        training.read_angles(tmp_path / "take.mot", body)
    (tmp_path / "empty.csv").write_text("frame,time\n0,0\n")
    with pytest.raises(RecordingError, match=r"the files share none of the angles hip"):
        training.fit([tmp_path / "empty.csv"], body)
    (tmp_path / "knee.csv").write_text("frame,knee_flexion_l\n0,10\n1,20\n")
    with pytest.raises(RecordingError, match=r"none of the angles elbow\n *knee\.csv: knee_l\.flexion"):
        training.fit([tmp_path / "knee.csv"], body, ["elbow"])
    with pytest.raises(PipelineError, match=r"no angle is called 'kne'\n.*did you mean 'knee'\?"):
        training.fit([tmp_path / "knee.csv"], body, ["knee_l", "kne"])
