import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_export import layout, runjson, tables
from mocapflow_export.export import Export
from mocapflow_sequence.smooth import Smooth
from results_scene import DEMO, ball_body, cameras, demo_scene, stepping

from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.mot import read_mot
from mocapflow.io.motion.opensim_axes import world_from_opensim
from mocapflow.io.motion.trc import read_trc
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.results import Files, RunFolder, Track
from mocapflow.scene import Scene

COLUMNS = [f"{n}_{s}" for n in ("knee_flexion", "hip_flexion", "ankle", "elbow") for s in "lr"]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return demo_scene()


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_recording(DEMO)


def exported(track: Track, scene: Scene, recording: Recording, folder: Path, **settings: object) -> Files:
    recipe = {
        "pipeline": Path("skirt.yaml"),
        "versions": {"numpy": np.__version__},
        "settings": {"track": {"name": "coupled_loop", "settings": {"damping": 0.5}}},
        "stages": {"start": {"seconds": np.float64(1.5), "warnings": ["a knee bends backwards"]}},
    }
    run_folder = RunFolder(path=folder, recipe=recipe)
    return Export(**settings).run(track=track, scene=scene, recording=recording, run_folder=run_folder)


@pytest.fixture(scope="module")
def folder(scene: Scene, recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run")
    track = stepping(scene.body)
    shaken = replace(track, angles=track.angles + 0.02 * np.random.default_rng(0).normal(size=track.angles.shape))
    exported(Smooth().run(track=shaken, scene=scene), scene, recording, path)
    return path


def test_angles_have_the_columns_of_the_truth_each_with_its_deviation(folder: Path) -> None:
    header = (folder / layout.ANGLES).read_text().splitlines()[0].split(",")
    assert header == [
        *("frame", "time"),
        *(column for name in COLUMNS for column in (name, f"{name}_sd")),
        *(f"{name}_observed" for name in COLUMNS),
    ]
    assert tables.angle_names(header) == COLUMNS
    columns = read_columns(folder / layout.ANGLES)
    assert (columns["frame"] == np.arange(40)).all()
    assert all(np.isfinite(v).all() for v in columns.values())


def test_a_repaired_garment_is_told_in_run_json(recording: Recording, tmp_path: Path) -> None:
    scene = demo_scene(clothed=True)
    assert scene.garment is not None
    mended = replace(scene, garment=replace(scene.garment, repairs=("waist_circumference_m 0.500 is tighter",)))
    exported(stepping(scene.body, 4), mended, recording, tmp_path)
    said = json.loads((tmp_path / layout.RUN).read_text())["warnings"]
    assert said == [f"{scene.garment.name}: waist_circumference_m 0.500 is tighter", "start: a knee bends backwards"]


def test_raw_angles_are_those_before_smoothing(folder: Path) -> None:
    smooth, raw = (read_columns(folder / part) for part in (layout.ANGLES, layout.RAW_ANGLES))
    assert list(smooth) == list(raw)
    jitter = [np.abs(np.diff(t["knee_flexion_l"], 2)).mean() for t in (smooth, raw)]
    assert jitter[0] < jitter[1]


def test_before_smoothing_nothing_is_known_of_a_lost_frame(scene: Scene, recording: Recording, tmp_path: Path) -> None:
    """Smoothing bridges it, and knows it as well as its neighbours allow."""
    track = stepping(scene.body, 12)
    lost = replace(track, iterations=np.where(track.frame == 6, 0, track.iterations).astype(np.int16))
    exported(Smooth().run(track=lost, scene=scene), scene, recording, tmp_path, formats=("csv",))
    smooth, raw = (read_columns(tmp_path / part)["knee_flexion_l_sd"] for part in (layout.ANGLES, layout.RAW_ANGLES))
    assert raw[6] > 150 and smooth[6] < 10  # deg
    np.testing.assert_allclose(np.delete(raw, 6), np.delete(smooth, 6), atol=1e-3)


def test_energy_has_a_row_per_frame_and_turn(folder: Path) -> None:
    columns = read_columns(folder / layout.ENERGY)
    assert list(columns) == ["frame", "turn", "cam01.data", "rest_pose"]
    assert columns["frame"][:4].tolist() == [0, 0, 1, 1]  # the third turn of the test's track was not needed
    assert columns["turn"][:4].tolist() == [0, 1, 0, 1]
    assert columns["cam01.data"][:2].tolist() == [1.0, 0.5]


def test_without_smoothing_both_tables_are_the_same(scene: Scene, recording: Recording, tmp_path: Path) -> None:
    exported(stepping(scene.body, 5), scene, recording, tmp_path, formats=("csv",))
    assert (tmp_path / layout.ANGLES).read_bytes() == (tmp_path / layout.RAW_ANGLES).read_bytes()
    assert not (tmp_path / layout.MOTION).exists()


def test_motion_file_reads_back_with_opensim_names(folder: Path) -> None:
    columns, time = read_mot(folder / layout.MOTION)
    wanted = {
        "pelvis_tilt",
        "pelvis_ty",
        "hip_flexion_r",
        "hip_adduction_l",
        "hip_rotation_r",
        "knee_angle_r",
        "ankle_angle_l",
    }
    assert wanted | {"elbow_flex_r", "arm_flex_l", "lumbar_extension"} <= set(columns)
    assert np.allclose(time, np.arange(40) / 30, atol=1e-6)
    assert columns["knee_angle_l"].max() > 25
    assert 0.7 < columns["pelvis_ty"].mean() < 1.1


def test_joint_centres_read_back_in_the_world(scene: Scene, recording: Recording, tmp_path: Path) -> None:
    track = stepping(scene.body, 5)
    exported(track, scene, recording, tmp_path)
    names, places, _, rate = read_trc(tmp_path / layout.JOINTS)
    joints, _ = kinematics.chain(scene.body, track.pose(3))
    assert names == scene.body.joint_names
    assert rate == pytest.approx(30)
    here = world_from_opensim(places[3])
    assert np.abs(here - kinematics.joint_positions(scene.body, joints)).max() < 1e-6


def test_a_frame_that_shows_nobody_is_lost(scene: Scene) -> None:
    track = stepping(scene.body, 4)
    observed = track.observed.copy()
    observed[2] = 1e-12  # rounding, of priors alone
    assert replace(track, observed=observed).lost.tolist() == [False, False, True, False]


def test_run_json_says_how_it_was_made_and_how_it_went(scene: Scene, recording: Recording, tmp_path: Path) -> None:
    track = stepping(scene.body, 6)
    turns, steady, usable = track.iterations.copy(), track.steady.copy(), track.usable.copy()
    turns[3], steady[2:4], usable[3, 1:] = 0, False, False
    overlap = track.overlap.copy()
    overlap[3] = np.nan
    note = "frame 3: seen by too few cameras; the prediction is kept"
    broken = replace(
        track, iterations=turns, steady=steady, usable=usable, overlap=overlap, notes=("frame 3: cam02 black", note),
        doubted=np.arange(6) == 4, oscillating=np.arange(6) == 2,
    )  # fmt: skip
    observed = track.observed.copy()
    observed[4:, scene.body.screw_names.index("knee_l.x")] = 0.2
    exported(Smooth().run(track=replace(broken, observed=observed), scene=scene), scene, recording, tmp_path)
    got = json.loads((tmp_path / layout.RUN).read_text())
    assert got["versions"] == {"numpy": np.__version__}
    assert got["settings"]["track"]["settings"] == {"damping": 0.5}
    assert set(got["recipe"]) == {"pipeline", "stages"}
    hip, knee = (scene.body.positions[scene.body.joint_names.index(name)] for name in ("hip_l", "knee_l"))
    assert got["body_m"]["thigh_l"] == pytest.approx(np.linalg.norm(hip - knee), abs=1e-4)
    assert got["body_m"]["height"] == pytest.approx(1.68, abs=0.005)  # of the demo clip's woman
    assert got["frames"]["lost"] == [3]
    assert "neighbouring" in got["frames"]["bridged_by"]
    assert (got["frames"]["not_at_rest"], got["frames"]["oscillating"]) == ([2, 3], [2])
    assert got["frames"]["doubted"] == [4]
    assert [frame.get("doubted", False) for frame in got["per_frame"]] == [False] * 4 + [True, False]
    assert got["frames"]["held_by_priors"] == {"knee_flexion_l": 2}
    assert got["cpu_seconds"]["per_step"] == pytest.approx({"segment": 0.06, "solve": 0.06})
    assert [f["iterations"] for f in got["per_frame"]] == [3, 3, 3, 0, 3, 3]
    assert got["per_frame"][3]["overlap"] == [None] * 4
    assert got["per_frame"][3]["unusable_views"] == [1, 2, 3]
    assert got["per_frame"][3]["notes"] == ["cam02 black", "seen by too few cameras; the prediction is kept"]


def test_files_count_frames_and_seconds_of_the_video(scene: Scene, recording: Recording, tmp_path: Path) -> None:
    track, frame = stepping(scene.body, 4), np.array([20, 22, 24, 26], np.int32)
    seconds, turns = np.array([[0.1, 0.2], [0.1, 0.2], [0.1, 0.2], [1.0, 2.0]]), np.array([3, 3, 0, 3], np.int16)
    late = replace(track, frame=frame, time=frame / 30, seconds=seconds, iterations=turns)
    exported(late, scene, replace(recording, indices=range(20, 28, 2)), tmp_path)
    got = json.loads((tmp_path / layout.RUN).read_text())
    assert [got["frames"][name] for name in ("count", "first", "last", "lost", "bridged_by")] == [4, 20, 26, [24], None]
    assert got["cpu_seconds"]["per_frame_median"] == pytest.approx(0.3)
    assert [each.get("lost") for each in got["per_frame"]] == [None, None, True, None]
    for time in (read_trc(tmp_path / layout.JOINTS)[2], read_mot(tmp_path / layout.MOTION)[1]):
        np.testing.assert_allclose(time, late.time, atol=1e-6)


def test_plain_makes_json_of_what_a_recipe_may_hold() -> None:
    odd = {"path": Path("a/b"), 1: (np.int32(2), np.nan), "set": {2}, "array": np.eye(2), "none": None}
    array = [[1.0, 0.0], [0.0, 1.0]]
    assert runjson.plain(odd) == {"path": "a/b", "1": [2, None], "set": [2], "array": array, "none": None}


def test_legs_alone_export(recording: Recording, tmp_path: Path) -> None:
    body = ball_body(("pelvis", "hip_l", "knee_l", "ankle_l", "toe_l", "hip_r", "knee_r", "ankle_r", "toe_r"))
    body = replace(body, cut=np.arange(len(body.vertices)) == 0)  # where the trunk was
    odd = replace(recording, warnings=("odd",))
    exported(stepping(body, 4), Scene(cameras=cameras(), body=body), odd, tmp_path)
    told = json.loads((tmp_path / layout.RUN).read_text())
    assert "height" not in told["body_m"] and "odd" in told["warnings"]
    assert tables.angle_names(read_columns(tmp_path / layout.ANGLES)) == COLUMNS[:6]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"frame,knee_flexion_l,knee_flexion_l\n0,1,2\n", r"t\.csv:1  two columns are called 'knee_flexion_l'"),
        (b"frame;knee_flexion_l\n0;1,5\n", r"t\.csv:1  the columns are divided by semicolons\n.*commas between"),
        (b"frame\tknee_flexion_l\n0\t1.5\n", r"t\.csv:1  the columns are divided by tabs\n.*commas between"),
        (b"frame,knee (\xb0)\n0,1\n", r"t\.csv  is not UTF-8 text\n"),
    ],
)
def test_tables_of_other_forms(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "t.csv").write_bytes(text)
    with pytest.raises(RecordingError, match=message):
        read_columns(tmp_path / "t.csv")


def test_table_with_a_missing_cell_says_where(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("frame,knee_flexion_l\n0,1.5\n1\n")
    with pytest.raises(Exception, match=r"t\.csv:3  1 columns; expected 2"):
        read_columns(tmp_path / "t.csv")
    (tmp_path / "t.csv").write_text("frame,knee_flexion_l\n\n\n0,x\n")
    with pytest.raises(RecordingError, match=r"t\.csv:4:\d  'x' is no number"):
        read_columns(tmp_path / "t.csv")
    (tmp_path / "t.csv").write_text(f"frame,knee_flexion_l\n0,{'1' * 200_000}\n")
    with pytest.raises(RecordingError, match=r"t\.csv:2  is no table: field larger than"):
        read_columns(tmp_path / "t.csv")


def test_a_note_stands_with_the_frame_of_its_number():
    track = replace(stepping(demo_scene().body, 9), notes=("frame 8: odd",))
    later = replace(track, frame=track.frame + 7)
    assert runjson._frame(later, 1, False, runjson.by_frame(later.notes))["notes"] == ["odd"]
    assert "notes" not in runjson._frame(later, 8, False, runjson.by_frame(later.notes))
