"""Joint centres and angles from markers, and how two rigs lie to each other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from marker_take import markers_of, write_c3d
from mocapflow_evaluation import marker_joints, tracked_motion
from mocapflow_evaluation.alignment import at_our_frames
from mocapflow_evaluation.evaluate import Evaluate, chosen, evaluate
from mocapflow_evaluation.marker_names import landmarks
from mocapflow_evaluation.references import Reference, read_reference
from mocapflow_evaluation.stick import Stick, constant, distances
from mocapflow_evaluation.tracked_motion import TrackedMotion
from mocapflow_export import layout, tables
from mocapflow_export.formats import Result, write
from results_scene import DEMO, demo_scene, make_track, stepping
from scipy.spatial.transform import Rotation

from mocapflow.errors import RecordingError
from mocapflow.geometry import angles
from mocapflow.io.motion.mot import write_mot
from mocapflow.io.motion.opensim_axes import opensim_from_world, world_from_opensim
from mocapflow.io.motion.trc import read_trc, write_trc
from mocapflow.recordings.recording import open_recording

SCENE = demo_scene()
TRACK = stepping(SCENE.body, 60)
RATE = 30.0
LABELS, PLACES = markers_of(SCENE.body, TRACK)


@pytest.fixture(scope="module")
def own() -> TrackedMotion:
    return tracked_motion.of_track(TRACK, SCENE)


def read(path: Path, places: np.ndarray = PLACES, rate: float = RATE, first: int = 0) -> Reference:
    pytest.importorskip("ezc3d")
    return read_reference(write_c3d(path / "markers.c3d", LABELS, places, rate, first))


def test_centres_lie_where_the_body_has_them(own: TrackedMotion, tmp_path: Path) -> None:
    reference = read(tmp_path)
    assert reference.joints is not None
    for joint in ("hip", "knee", "ankle", "toe", "elbow", "wrist"):
        for name in (f"{joint}_l", f"{joint}_r"):
            got = reference.joints[:, reference.joint_names.index(name)]
            expected = own.stick.places[:, own.stick.names.index(name)]
            np.testing.assert_allclose(got, expected, atol=1e-6, err_msg=name)  # m; C3D holds single precision


@pytest.mark.parametrize(
    ("name", "apart_deg"), [("knee_flexion", 1e-3), ("hip_flexion", 1e-3), ("ankle", 1e-3), ("knee_angle", 0.2)]
)
def test_angles_from_markers_are_ours(own: TrackedMotion, name: str, apart_deg: float, tmp_path: Path) -> None:
    """The body's knee does not turn about quite the line between its markers."""
    reference = read(tmp_path)
    for side in ("l", "r"):
        np.testing.assert_allclose(reference.curves[f"{name}_{side}"], own.columns[f"{name}_{side}"], atol=apart_deg)


def test_knee_about_its_axis_is_signed() -> None:
    hip, knee = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, 0.5]])
    axis = np.array([[0.0, 1, 0]])  # to the left of a person who looks along x
    bend = np.radians([-10.0, 0.0, 60.0])
    for angle in bend:
        ankle = knee + 0.5 * np.array([[-np.sin(angle), 0, -np.cos(angle)]])  # heel to the back
        got = marker_joints.signed_flexion(hip, knee, ankle, axis)
        assert got[0] == pytest.approx(np.degrees(angle))


def test_shoulders_lie_below_the_acromia_along_the_trunk() -> None:
    """Rab 2002: by 17 % of the distance between them; the hips' middle is straight below theirs."""
    front, back = 0.24 * 0.15 + 0.0099, 0.24 * 0.15 + 0.0099 - 0.15  # of who looks along x
    marks = {
        f"{name}_{side}": np.array([[x, sign * aside, up]])
        for name, x, aside, up in (("asis", front, 0.12, 0.95), ("psis", back, 0.05, 0.95), ("acromion", 0.0, 0.2, 1.4))
        for side, sign in (("l", 1), ("r", -1))
    }
    centres = marker_joints.joint_centres(marks)
    for side, sign in (("l", 1), ("r", -1)):
        np.testing.assert_allclose(centres[f"shoulder_{side}"], [[0, sign * 0.2, 1.4 - 0.17 * 0.4]], atol=1e-12)


def test_knee_axes_of_both_sides_point_to_the_left(own: TrackedMotion) -> None:
    marks = {name: PLACES[:, k] for name, k in landmarks(LABELS, Path()).items()}
    left = own.stick.places[:, own.stick.names.index("hip_l")] - own.stick.places[:, own.stick.names.index("hip_r")]
    for side in ("l", "r"):
        assert (np.sum(marker_joints.knee_axis(marks, side) * left, axis=1) > 0).all()


def test_names_of_other_laboratories_are_known(tmp_path: Path) -> None:
    found = landmarks(
        ["L_IAS", "R.Knee.Lat", "L_mknee_study", "r.ASIS_study", "*23", "Lab:Anna:L-KNE", "SACR"], tmp_path
    )
    assert found == {"asis_l": 0, "asis_r": 3, "knee_lateral_r": 1, "knee_lateral_l": 5, "knee_medial_l": 2}


def test_names_can_be_told(tmp_path: Path) -> None:
    (tmp_path / "markers.toml").write_text('knee_medial_l = "Inner"\n')
    assert landmarks(["Inner", "LKNM"], tmp_path)["knee_medial_l"] == 0
    with pytest.raises(RecordingError, match=r"no marker 'Inner'"):
        landmarks(["LKNM"], tmp_path)
    (tmp_path / "markers.toml").write_text('knee_inner_l = "Inner"\n')
    with pytest.raises(RecordingError, match=r"unknown landmark 'knee_inner_l'(.|\n)*knee_"):
        landmarks(["Inner"], tmp_path)


def test_markers_of_two_people_are_not_mixed(tmp_path: Path) -> None:
    labels = ["Anna:LKNE", "Bert:LKNE", "Bert:LKNM", "Ball:top"]
    with pytest.raises(RecordingError, match=r"\.toml  there are markers of 2 subjects: Anna, Bert\n.*export one"):
        landmarks(labels, tmp_path)
    assert landmarks([label for label in labels if "Anna" not in label], tmp_path) == {
        "knee_lateral_l": 0,
        "knee_medial_l": 1,
    }
    (tmp_path / "markers.toml").write_text('knee_lateral_l = "Bert:LKNE"\n')
    assert landmarks(labels, tmp_path) == {"knee_lateral_l": 1}


def test_markers_that_name_no_subject_are_those_of_who_is_named_unless_both_have_one(tmp_path: Path) -> None:
    assert landmarks(["Anna:LKNE", "LKNM"], tmp_path) == {"knee_lateral_l": 0, "knee_medial_l": 1}
    with pytest.raises(RecordingError, match="markers of 2 subjects: Anna, one without a name"):
        landmarks(["Anna:LKNE", "LKNE"], tmp_path)


def test_of_two_markers_of_one_name_the_first_is_taken(tmp_path: Path) -> None:
    assert landmarks(["LKNE", "L.KNE"], tmp_path) == {"knee_lateral_l": 0}


def test_joint_centres_of_a_trc_are_taken_to_our_axes(own: TrackedMotion, tmp_path: Path) -> None:
    write_trc(tmp_path / "m.trc", own.stick.names, opensim_from_world(own.stick.places), RATE)
    np.testing.assert_allclose(read_reference(tmp_path / "m.trc").joints, own.stick.places, atol=1e-7)


@pytest.mark.parametrize("start", [0, 1])
def test_a_trc_may_begin_at_one_sample_too(own: TrackedMotion, tmp_path: Path, start: int) -> None:
    write_trc(tmp_path / "m.trc", own.stick.names, opensim_from_world(own.stick.places), RATE, start=start / RATE)
    assert read_reference(tmp_path / "m.trc").counted_from == pytest.approx(start / RATE, abs=1e-6)


def test_markers_that_tell_nothing_say_what_to_do(tmp_path: Path) -> None:
    write_trc(tmp_path / "m.trc", ["A", "B"], np.zeros((3, 2, 3)), 100.0)
    with pytest.raises(RecordingError, match=r"neither joint centres nor markers(.|\n)*markers\.toml(.|\n)*A, B"):
        read_reference(tmp_path / "m.trc")


def test_a_knee_without_its_inner_marker_is_left_out(tmp_path: Path) -> None:
    kept = [k for k, label in enumerate(LABELS) if not label.endswith("LKNM")]
    write_trc(tmp_path / "m.trc", [LABELS[k] for k in kept], opensim_from_world(PLACES[:, kept]), RATE)
    assert {"knee_flexion_r", "knee_angle_r"} <= set(read_reference(tmp_path / "m.trc").curves)
    assert "knee_flexion_l" not in read_reference(tmp_path / "m.trc").curves


def test_a_leg_without_markers_of_its_ankle_has_the_angle_of_its_hip_alone(tmp_path: Path) -> None:
    kept = [k for k, label in enumerate(LABELS) if not label.endswith(("LANK", "LMED"))]
    write_trc(tmp_path / "m.trc", [LABELS[k] for k in kept], opensim_from_world(PLACES[:, kept]), RATE)
    found = read_reference(tmp_path / "m.trc").curves
    assert "hip_flexion_l" in found and {"knee_angle_l", "knee_flexion_l", "ankle_l"}.isdisjoint(found)


def test_a_leg_without_markers_of_the_pelvis_has_the_angle_of_its_ankle_alone(tmp_path: Path) -> None:
    kept = [k for k, label in enumerate(LABELS) if not label.endswith(("ASI", "PSI"))]
    write_trc(tmp_path / "m.trc", [LABELS[k] for k in kept], opensim_from_world(PLACES[:, kept]), RATE)
    assert {"ankle_l", "ankle_r"} == {name for name in read_reference(tmp_path / "m.trc").curves if "elbow" not in name}


def moved(places: np.ndarray) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """Return markers in a rig of their own, and where that lies."""
    turn, shift = Rotation.from_euler("zyx", [70, -4, 8], degrees=True), np.array([3.0, -1.0, 0.2])
    return turn.apply(places.reshape(-1, 3)).reshape(places.shape) + shift, turn, shift


def measure_wand(folder: Path, scale: float = 1.0) -> None:
    """Write 20 points that both rigs have measured, one to a millimetre and on another scale."""
    wand = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    noisy = scale * moved(wand)[0] + np.random.default_rng(1).normal(scale=0.001, size=wand.shape)
    names = "x,y,z,marker_x,marker_y,marker_z"
    np.savetxt(folder / "registration.csv", np.hstack([wand, noisy]), delimiter=",", header=names, comments="")


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("scale", "told"), [(0.997, True), (0.999, False), (1.001, False), (1.003, True)])
def test_rigs_whose_metres_differ_by_more_than_a_fifth_of_a_percent_are_told(
    own: TrackedMotion, tmp_path: Path, scale: float, told: bool
) -> None:
    read(tmp_path, moved(PLACES)[0])
    measure_wand(tmp_path, scale)
    notes = " ".join(evaluate(own, tmp_path / "markers.c3d", tmp_path / "run").notes)
    assert f"scale {1 / scale:.3f}" in notes
    assert ("the scale is not applied: check units and calibrations of both" in notes) == told


def test_common_points_that_can_not_be_read_are_told_before_anything_runs(tmp_path: Path) -> None:
    write_trc(tmp_path / "m.trc", LABELS, opensim_from_world(PLACES), RATE)
    recording, stage = open_recording(DEMO), Evaluate(reference=str(tmp_path / "m.trc"))
    stage.need(recording)
    (tmp_path / "registration.csv").write_text("x,y,z\n0,0,0\n")
    with pytest.raises(RecordingError, match="no column marker_x"):
        stage.need(recording)
    (tmp_path / "t.csv").write_text("frame,knee_flexion_l\n0,9\n")  # angles need no common points
    Evaluate(reference=str(tmp_path / "t.csv")).need(recording)


@pytest.mark.usefixtures("undrawn")
def test_two_rigs_are_brought_together_by_common_points(own: TrackedMotion, tmp_path: Path) -> None:
    read(tmp_path, moved(PLACES)[0])
    measure_wand(tmp_path)
    got = evaluate(own, tmp_path / "markers.c3d", tmp_path / "run")
    figures = json.loads((tmp_path / "run" / layout.FINDINGS).read_text())["registration"]
    residual, left_out = figures["residual_rms_mm"], figures["leave_one_out_rms_mm"]
    assert 1.2 < residual < left_out < 2.5  # of a millimetre along each axis
    sizes = f"residual {residual:.1f} mm, leave-one-out {left_out:.1f} mm"
    assert any(f"registered by 20 points of registration.csv: {sizes}" in note for note in got.notes)
    far = tables_of_words(tmp_path / "run" / layout.DISTANCES)
    assert all(float(row["max_mm"]) < 5 for row in far if row["joint"] not in ("shoulder_l", "shoulder_r"))
    assert all(
        float(row["rms_deg"]) < 0.01 for row in got.rows if str(row["angle"]).startswith(("knee_flexion", "hip"))
    )


@pytest.mark.usefixtures("unrendered")
@pytest.mark.long
def test_without_common_points_joint_centres_do(own: TrackedMotion, tmp_path: Path) -> None:
    read(tmp_path, moved(PLACES)[0])
    got = evaluate(own, tmp_path / "markers.c3d", tmp_path)
    assert any("registered by joint centres of both systems" in note for note in got.notes)
    assert {path.name for path in got.pictures} == {"agreement.png", "stick_model.png"}
    names, places, _, _ = read_trc(tmp_path / layout.STICK)
    knee = world_from_opensim(places)[:, names.index("knee_l")]
    assert np.linalg.norm(knee - own.stick.places[:, own.stick.names.index("knee_l")], axis=1).max() < 0.03


@pytest.mark.usefixtures("unrendered")
def test_rigs_without_common_joint_centres_are_not_compared_which_is_told(own: TrackedMotion, tmp_path: Path) -> None:
    read(tmp_path, moved(PLACES)[0])
    strange = replace(own.stick, names=tuple(f"{name}_of_another" for name in own.stick.names))
    got = evaluate(replace(own, stick=strange), tmp_path / "markers.c3d", tmp_path)
    assert got.rows and not (tmp_path / layout.DISTANCES).exists()
    assert "no joint distances: too few joint centres that both systems have" in got.notes


def test_distances_from_none_to_ten_centimetres() -> None:
    names, ours = ("knee_l", "knee_r", "ankle_l"), np.zeros((101, 3, 3))
    theirs, aligned = ours.copy(), ours.copy()
    theirs[:, 0, 2], theirs[:, 1] = 0.001 * np.arange(101), np.nan  # m; one knee is never seen
    theirs[0, 2, :2], aligned[:, 0, 1], aligned[:, 2] = [0.003, 0.004], 0.03, np.nan
    sticks = [Stick(names=names, places=places) for places in (ours, theirs, aligned)]
    knee, ankle = distances(*sticks)
    figures = {"frames": 101, "mean_mm": 50, "median_mm": 50, "p95_mm": 95, "max_mm": 100, "mean_aligned_mm": 30}
    assert knee.pop("joint") == "knee_l" and knee == pytest.approx(figures)
    assert (ankle["joint"], ankle["max_mm"]) == ("ankle_l", 5) and np.isnan(float(ankle["mean_aligned_mm"]))


def test_a_segment_keeps_its_direction_and_takes_its_usual_length() -> None:
    shank = np.array([[0.3, 0, -0.4], [0.36, 0, -0.48], [0, np.nan, 0], [0, 0, -0.4]])  # m; 0.5, 0.6, unknown, 0.4
    knee = np.ones((4, 3))
    laid = constant(Stick(names=("knee_l", "ankle_l"), places=np.stack([knee, knee + shank], axis=1))).places
    np.testing.assert_allclose(laid[:, 0], knee)
    np.testing.assert_allclose(laid[[0, 1, 3], 1] - knee[0], [[0.3, 0, -0.4], [0.3, 0, -0.4], [0, 0, -0.5]])


@pytest.mark.usefixtures("undrawn")
def test_the_stick_model_has_the_times_of_the_track(own: TrackedMotion, tmp_path: Path) -> None:
    read(tmp_path, moved(PLACES)[0])
    columns, raw = ({name: values[10:] for name, values in part.items()} for part in (own.columns, own.raw))
    late = TrackedMotion(columns=columns, raw=raw, stick=replace(own.stick, places=own.stick.places[10:]))
    evaluate(late, tmp_path / "markers.c3d", tmp_path)
    np.testing.assert_allclose(read_trc(tmp_path / layout.STICK)[2], columns["time"], atol=1e-6)


@pytest.mark.usefixtures("undrawn")
def test_the_stick_model_keeps_its_lengths(own: TrackedMotion, tmp_path: Path) -> None:
    """T-OUT1."""
    loose = PLACES + np.random.default_rng(0).normal(scale=0.005, size=PLACES.shape)
    read(tmp_path, loose)
    evaluate(own, tmp_path / "markers.c3d", tmp_path)
    names, places, _, _ = read_trc(tmp_path / layout.STICK)
    at = {name: places[:, k] for k, name in enumerate(names)}
    for a, b in (("hip_l", "knee_l"), ("knee_r", "ankle_r")):
        length = np.linalg.norm(at[b] - at[a], axis=1)
        assert np.ptp(length) < 1e-6
        body = np.linalg.norm(SCENE.body.positions[SCENE.body.joint(b)] - SCENE.body.positions[SCENE.body.joint(a)])
        assert length[0] == pytest.approx(body, abs=0.003)


@pytest.mark.usefixtures("unrendered")
def test_a_faster_marker_system_that_started_later(own: TrackedMotion, tmp_path: Path) -> None:
    """Markers at 100 per second from 0.2 s on are met at our times; a lag of 2 frames is found and not applied."""
    time = np.arange(0, 59 / RATE, 0.01)
    fine = np.stack([np.interp(time - 2 / RATE, TRACK.time, column) for column in PLACES.reshape(60, -1).T], axis=1)
    read(tmp_path, fine.reshape(len(time), -1, 3)[20:], rate=100.0, first=20)
    got = evaluate(own, tmp_path / "markers.c3d", tmp_path)
    knee = next(row for row in got.rows if row["angle"] == "knee_flexion_l")
    assert knee["frames"] == 53  # ours from 0.2 to 1.93 s
    assert float(knee["rms_aligned_deg"]) < 0.5
    assert float(knee["rms_deg"]) > 2
    far = {row["joint"]: row for row in tables_of_words(tmp_path / layout.DISTANCES)}
    for ankle in (far["ankle_l"], far["ankle_r"]):
        assert float(ankle["mean_aligned_mm"]) < 0.2 * float(ankle["mean_mm"])
    assert any("we come 2.0 frames (67 ms) earlier than the reference" in note for note in got.notes)
    assert any("reference at 100 per second, interpolated at our 30" in note for note in got.notes)


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize("kept", [slice(1, 20), slice(3, 60, 3), slice(10, 60, 3)], ids=str)
@pytest.mark.parametrize("name", ["joints.c3d", "joints.trc", "angles.mot"])
@pytest.mark.long
def test_a_run_against_its_own_files_is_off_by_nothing(tmp_path: Path, name: str, kept: slice) -> None:
    pytest.importorskip("ezc3d")
    track = make_track(TRACK.root[kept], TRACK.angles[kept])
    track = replace(track, frame=TRACK.frame[kept], time=TRACK.time[kept])
    own = tracked_motion.of_track(track, SCENE)
    if name == "joints.c3d":
        write("c3d", Result(track=track, scene=SCENE, recording=open_recording(DEMO)), tmp_path)
    elif name == "joints.trc":
        places = opensim_from_world(own.stick.places)
        write_trc(tmp_path / name, own.stick.names, places, track.frame_rate, start=track.time[0])
    else:
        write_mot(tmp_path / name, {"hip_flexion_l": own.columns["hip_flexion_l"]}, track.time)
    rows = evaluate(own, tmp_path / name, tmp_path).rows
    assert {row["frames"] for row in rows} == {len(track.frame)}
    for row in rows:
        assert float(row["rms_deg"]) < 0.01, row["angle"]


@pytest.mark.parametrize("decimals", [8, 3])
def test_times_that_begin_at_one_sample_are_told(tmp_path: Path, decimals: int) -> None:
    curve = 30 + np.arange(50.0)
    write_mot(tmp_path / "m.mot", {"knee_angle_r": curve}, np.round(np.arange(1, 51) / 60, decimals))
    reference = read_reference(tmp_path / "m.mot")
    assert "one sample: taken as 0, unless our first frame is there" in reference.notes[0]
    for first in (0, 1):
        ours = {"time": np.arange(first, 50) / 60}
        found = at_our_frames(reference, ours)["knee_angle_r"][1:-1]  # the ends may be a rounding outside
        np.testing.assert_allclose(found, curve[1 : 49 - first], atol=0.1)


def test_times_that_begin_otherwise_are_as_they_are(tmp_path: Path) -> None:
    curve = 30 + np.arange(50.0)
    write_mot(tmp_path / "m.mot", {"knee_angle_r": curve}, np.arange(50) / 60)
    found = at_our_frames(read_reference(tmp_path / "m.mot"), {"time": np.arange(10, 50) / 60})["knee_angle_r"]
    np.testing.assert_allclose(found, curve[10:], atol=0.01)


def test_a_reference_without_rows_shares_nothing(own: TrackedMotion, tmp_path: Path) -> None:
    write_mot(tmp_path / "m.mot", {"knee_angle_r": np.empty(0)}, np.empty(0))
    assert "shares no angle with the track" in evaluate(own, tmp_path / "m.mot", tmp_path).notes[-1]


@pytest.mark.usefixtures("unrendered")
def test_a_reference_of_other_frames_says_which(own: TrackedMotion, tmp_path: Path) -> None:
    last = len(own.columns["frame"]) - 1
    for clock, unit, end in (("frame", "", f"{last}"), ("time", " s", f"{last / RATE:g}")):
        (tmp_path / "t.csv").write_text(f"{clock},knee_flexion_l\n1000,9\n1001,10\n")
        theirs, ours = f"{clock} 1000 to 1001{unit}", f"{clock} 0 to {end}{unit}"
        said = f"the reference has no angle where the track has one: it has {theirs}, the track {ours}"
        assert evaluate(own, tmp_path / "t.csv", tmp_path).notes[-1] == said


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize("first", [0, 1])
def test_frames_that_count_from_one_are_told_by_their_times(own: TrackedMotion, tmp_path: Path, first: int) -> None:
    columns = {name: own.columns[name][::2] for name in ("frame", "time", "knee_flexion_l")}
    tables.write_columns(tmp_path / "other.csv", columns | {"frame": columns["frame"] + first})
    said = "frames are matched by number, but the reference's time is off by -0.0333 s: does it count from 1?"
    notes = evaluate(own, tmp_path / "other.csv", tmp_path).notes
    assert [note for note in notes if "by number" in note] == [said] * first


def test_the_file_in_reference_is_found(tmp_path: Path) -> None:
    assert chosen(tmp_path, "")[0] is None
    (tmp_path / "reference").mkdir()
    (tmp_path / "reference/registration.csv").touch()
    (tmp_path / "reference/walk.c3d").touch()
    (tmp_path / "reference/._walk.c3d").touch()  # as a Mac leaves them on other disks
    assert chosen(tmp_path, "") == (tmp_path / "reference/walk.c3d", "")
    (tmp_path / "reference/walk.trc").touch()
    path, note = chosen(tmp_path, "")
    assert path is None
    assert "reference/ holds walk.c3d, walk.trc: name one" in note


def tables_of_words(path: Path) -> list[dict[str, str]]:
    header, *rows = (line.split(",") for line in path.read_text().splitlines())
    return [dict(zip(header, row, strict=True)) for row in rows]


def test_our_side_from_files_is_that_from_the_track(own: TrackedMotion, tmp_path: Path) -> None:
    angles_only = {n: v for n, v in own.columns.items() if n not in tracked_motion.SIGNED}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), angles_only)
    write_trc(layout.place(tmp_path, layout.JOINTS), own.stick.names, opensim_from_world(own.stick.places), RATE)
    write_mot(layout.place(tmp_path, layout.MOTION), {n: own.columns[n] for n in tracked_motion.SIGNED}, TRACK.time)
    assert tracked_motion.of_folder(tmp_path).raw.keys() == angles_only.keys()
    clock = {name: own.columns[name] for name in ("frame", "time")}
    tables.write_columns(layout.place(tmp_path, layout.RAW_ANGLES), clock)
    got = tracked_motion.of_folder(tmp_path)
    assert set(got.columns) == set(own.columns) and got.raw.keys() == clock.keys()
    np.testing.assert_allclose(got.stick.places, own.stick.places, atol=1e-7)
    assert got.frame_rate == pytest.approx(RATE, abs=0.01)
    assert len(angles.definitions(got.stick.names)) == 8


def test_another_run_is_a_reference_by_its_angles_alone(tmp_path: Path) -> None:
    (tmp_path / "angles.csv").write_text(
        "frame,time,knee_flexion_l,knee_flexion_l_sd,knee_flexion_l_observed\n0,0,1,2,1\n"
    )
    assert list(read_reference(tmp_path / "angles.csv").curves) == ["knee_flexion_l"]


def test_a_knee_of_opensim_is_compared_as_signed_too(tmp_path: Path) -> None:
    bend = np.array([-4.0, 0.0, 30.0])
    several = {"knee_angle_l": bend, "elbow_flex_l": bend, "ankle_angle_l": bend}
    write_mot(tmp_path / "m.sto", several, np.arange(3) / 30)
    assert read_reference(tmp_path / "m.sto").notes[-1].endswith("may be off by a constant: ankle_l")
    write_mot(tmp_path / "m.mot", {"knee_angle_l": bend}, np.arange(3) / 30)
    curves = read_reference(tmp_path / "m.mot").curves
    assert not any("constant" in note for note in read_reference(tmp_path / "m.mot").notes)
    np.testing.assert_allclose(curves["knee_angle_l"], bend)
    assert set(curves) == {"knee_angle_l", "knee_flexion_l"}
