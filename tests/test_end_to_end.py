"""The real command line on the demo clips: what README promises, whatever happens on the way."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from mocapflow.help.shipped import shipped
from tests.fixtures.true_keypoints import write_true_keypoints

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
PIPELINES = shipped("pipelines")
CLIPS = {name: shipped("examples", "data", f"{name}_steps") for name in ("skirt", "shorts")}
NO_PICTURES = [part for stage in ("overlay", "virtual", "report") for part in ("--set", f"stages.{stage}=null")]
FEW = ("--frames", "0:5", *NO_PICTURES)
OTHERS = ("paper", "bare", "legs", "large_motion", "disturbed", "disturbed_added", "corrupted")  # on the clips too
UNSHIPPED = ("balancing", "disturbed_balancing")  # whose recording does not come with mocapflow
long = pytest.mark.long


def call(*words, cwd, status=0):
    """Run a command in a folder and return what it says on its way."""
    done = subprocess.run([MOCAPFLOW, *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    return done.stderr


def table(path):
    with path.open(newline="", encoding="utf-8") as lines:
        rows = list(csv.reader(lines))
    return dict(zip(rows[0], np.array(rows[1:], float).T, strict=True))


def rows_after(path, heading):
    """The rows of numbers in an OpenSim file, after the line that starts with `heading`."""
    lines = path.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(heading))
    return [line.split() for line in lines[first + 1 :] if line[:1].isdigit()]


def same_angles(one, other):
    """Both runs wrote the same, to the last digit."""
    for name in ("angles.csv", "angles_raw.csv", "joints.trc"):
        assert (one / "results" / name).read_bytes() == (other / "results" / name).read_bytes()
    return True


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Where the run folders lie; they share a store."""
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def whole(home):
    """Run folders of both clips, all frames; the demo is the skirt, called from somewhere else."""
    call("demo", "--out", home / "skirt", cwd=home)
    call("run", PIPELINES / "shorts.yaml", "--out", home / "shorts", *NO_PICTURES, cwd=home)
    return {name: home / name for name in CLIPS}


@pytest.fixture(scope="module")
def without_plates(home):
    """Run folders of both clips, all frames, tracked as if nobody had taken pictures of the empty room."""
    learnt = ("--set", "stages.background={use: background, source: recording}")
    for name in CLIPS:
        out = home / f"{name}_without_plates"
        call("run", PIPELINES / f"{name}.yaml", *learnt, "--out", out, *NO_PICTURES, cwd=home)
    return {name: home / f"{name}_without_plates" for name in CLIPS}


@pytest.fixture(scope="module")
def few(home):
    """A run of five frames of the shorts that nothing disturbed."""
    call("run", PIPELINES / "shorts.yaml", *FEW, "--out", home / "few", cwd=home)
    return home / "few"


@long
def test_two_frames_without_cloth(tmp_path):
    said = call(
        *("run", PIPELINES / "bare.yaml", "--recording", CLIPS["shorts"], "--frames", "0:2", "--out", "out"),
        *NO_PICTURES,
        cwd=tmp_path,
    )
    assert "track: 2 of 2 frames" in said
    ours, truth = table(tmp_path / "out/results/angles.csv"), table(CLIPS["shorts"] / "truth/angles.csv")
    assert ours["frame"].tolist() == [0, 1]
    assert np.abs(ours["elbow_l"] - truth["elbow_l"][:2]).max() < 5


@long
@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("side", ["l", "r"])
def test_knees_under_cloth_within_three_degrees(whole, clip, side):
    """T-EXP1, on the two short clips that are shipped."""
    assert rms_deg(whole[clip], clip, f"knee_flexion_{side}") <= 3.0


@long
@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("angle", ["knee_flexion_l", "knee_flexion_r", "elbow_l", "elbow_r"])
def test_limbs_within_three_degrees_without_clean_plates(without_plates, clip, angle):
    assert rms_deg(without_plates[clip], clip, angle) <= 3.0


def rms_deg(folder, clip, angle):
    ours, truth = table(folder / "results/angles.csv"), table(CLIPS[clip] / "truth/angles.csv")
    error = ours[angle] - truth[angle]
    assert len(error) == 60
    return np.sqrt(np.mean(error**2))


@pytest.fixture(scope="module")
def upper_half(home):
    """The recording of the shorts as cameras see it that look higher: shanks and feet are in no view."""
    folder, size = home / "upper_half", (320, 200)
    shutil.copytree(CLIPS["shorts"], folder, ignore=shutil.ignore_patterns("videos", "background"))
    told = (folder / "cameras.toml").read_text()
    (folder / "cameras.toml").write_text(told.replace("[320, 400]", str([*size])))
    (folder / "background").mkdir()
    for plate in (CLIPS["shorts"] / "background").iterdir():
        cv2.imwrite(str(folder / "background" / plate.name), cv2.imread(str(plate))[: size[1]])
    for video in (CLIPS["shorts"] / "videos").iterdir():
        (folder / "videos" / video.stem).mkdir(parents=True)
        pictures = cv2.VideoCapture(str(video))
        for frame in range(8):
            cv2.imwrite(str(folder / "videos" / video.stem / f"{frame:06d}.png"), pictures.read()[1][: size[1]])
    return folder


@long
def test_a_leg_out_of_all_views_rests_on_the_prior_and_is_told(home, upper_half):
    priors = "stages.track.priors=[joint_limits, rest_pose, spine_coupling, smooth_motion, parzen]"
    out = home / "unseen"
    call(
        "run",
        PIPELINES / "shorts.yaml",
        "--recording",
        upper_half,
        "--set",
        priors,
        "--out",
        out,
        *NO_PICTURES,
        cwd=home,
    )
    ours, truth = table(out / "results/angles.csv"), table(CLIPS["shorts"] / "truth/angles.csv")
    for name in ("knee_flexion_l", "ankle_l"):
        assert (ours[f"{name}_observed"] < 0.1).all()
        assert np.abs(ours[name] - truth[name][:8]).max() < 10
    for name in ("elbow_l", "elbow_r"):
        assert (ours[f"{name}_observed"] > 0.5).all()
    held = json.loads((out / "run.json").read_text())["frames"]["held_by_priors"]
    assert held["knee_flexion_l"] == held["ankle_l"] == 8 and "elbow_l" not in held


@long
def test_the_interval_of_ninety_per_cent_holds_the_truth_as_often(whole):
    """Both clips are of the takes that the deviations were calibrated on, and kinder than most: they hold more."""
    inside = []
    for clip, folder in CLIPS.items():
        ours, truth = table(whole[clip] / "results/angles.csv"), table(folder / "truth/angles.csv")
        angles = [name for name in truth if name != "frame"]
        inside += [np.abs(ours[name] - truth[name]) <= 1.645 * ours[f"{name}_sd"] for name in angles]
    assert np.mean(inside) >= 0.9
    assert min(map(np.mean, inside)) >= 0.75


@long
@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("file", ["angles.csv", "angles_raw.csv"])
def test_every_frame_has_every_angle_and_its_deviation(whole, clip, file):
    ours, truth = table(whole[clip] / "results" / file), table(CLIPS[clip] / "truth/angles.csv")
    angles = [name for name in truth if name != "frame"]
    pairs = [column for name in angles for column in (name, f"{name}_sd")]
    assert list(ours) == ["frame", "time", *pairs, *(f"{name}_observed" for name in angles)]
    np.testing.assert_array_equal(ours["frame"], truth["frame"])
    assert (np.diff(ours["time"]) > 0).all()
    assert all(np.isfinite(column).all() for column in ours.values())
    assert all((ours[f"{name}_sd"] > 0).all() for name in angles)
    assert all((ours[f"{name}_observed"] > 0.5).all() for name in angles if name.startswith("knee"))


@long
@pytest.mark.parametrize("clip", CLIPS)
def test_files_for_opensim_and_the_record_of_the_run(whole, clip):
    results = whole[clip] / "results"
    assert len(rows_after(results / "angles.mot", "endheader")) == 60
    assert [row[0] for row in rows_after(results / "joints.trc", "Frame#")] == [str(k) for k in range(1, 61)]
    record = json.loads((whole[clip] / "run.json").read_text())
    assert record["settings"]["track"]["name"] == "coupled_loop"
    assert "\nknee_flexion_l,60," in (results / "evaluation.csv").read_text()


@long
def test_the_videos_can_be_read_back(whole):
    videos = sorted((whole["skirt"] / "overlay").glob("*.mp4")) + [whole["skirt"] / "virtual/virtual.mp4"]
    assert len(videos) == 5
    for video in videos:
        capture, frames = cv2.VideoCapture(str(video)), []
        while True:
            there, frame = capture.read()
            if not there:
                break
            frames.append(frame)
        assert len(frames) == 60
        assert np.std(frames[0]) > 5


@long
def test_a_second_run_computes_nothing(whole, home):
    """Files are written again, from results that are there.

    Nor does the same pipeline by another name and into another folder: results are found by what makes them.
    """
    before = (whole["skirt"] / "results/angles.csv").read_bytes()
    for words in (
        ("demo", "--out", whole["skirt"]),
        ("run", PIPELINES / "skirt.yaml", "--out", home / "again", *NO_PICTURES),
    ):
        lines = call(*words, cwd=home).splitlines()
        assert {f"{stage}: from the store" for stage in ("background", "start", "track", "smooth")} <= set(lines)
        running = {line.split(":")[0] for line in lines if ": running" in line}
        # `exposure` but says how frames are to be read
        assert running <= {"exposure", "export", "evaluate", "overlay", "virtual", "report"}
    assert (whole["skirt"] / "results/angles.csv").read_bytes() == before
    assert same_angles(home / "again", whole["skirt"])


@long
def test_the_truth_is_not_looked_at(few, tmp_path):
    recording = tmp_path / "recording"
    shutil.copytree(CLIPS["shorts"], recording, ignore=shutil.ignore_patterns("truth", "reference"))
    call("run", PIPELINES / "shorts.yaml", "--recording", recording, *FEW, "--out", "out", cwd=tmp_path)
    assert not (recording / "truth").exists()
    assert same_angles(tmp_path / "out", few)


@long
@pytest.mark.parametrize("after", ["track: running", "track: [1-4] of 5 frames"])
def test_a_killed_run_goes_on_to_the_same_result(few, tmp_path, after):
    words = ["run", PIPELINES / "shorts.yaml", *FEW, "--out", "out"]
    with subprocess.Popen(
        [MOCAPFLOW, *map(str, words)], cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as run:
        assert any(re.match(after, line) for line in run.stderr)  # progress is told once a second, not every frame
        os.kill(run.pid, signal.SIGKILL)
    assert run.returncode == -signal.SIGKILL
    assert not (tmp_path / "out/results/angles.csv").exists()
    said = call(*words, cwd=tmp_path)
    assert ("track: 1 of 5 frames" in said) == (after == "track: running")
    assert same_angles(tmp_path / "out", few)


@long
@pytest.mark.parametrize("pipeline", OTHERS)
def test_the_other_pipelines_run(tmp_path, pipeline):
    said = call("run", PIPELINES / f"{pipeline}.yaml", "--frames", "0:2", "--out", "out", *NO_PICTURES, cwd=tmp_path)
    assert "track: 2 of 2 frames" in said
    assert len(table(tmp_path / "out/results/angles.csv")["frame"]) == 2


@long
def test_a_skirt_with_two_sleeves_is_tracked(tmp_path):
    recording = tmp_path / "recording"
    shutil.copytree(CLIPS["skirt"], recording)
    measured = recording / "subject" / "garment.json"
    sleeves = [
        {"type": "cylinder", "joint": f"shoulder_{side}", "start": 0.2, "upper_circumference": 0.36,
         "lower_circumference": 0.40, "length": 0.2}
        for side in "lr"
    ]  # fmt: skip
    measured.write_text(json.dumps([json.loads(measured.read_text()), *sleeves]))
    call("doctor", recording, cwd=tmp_path)
    call("show", "garment", "outfit", "--recording", recording, "--out", "outfit.png", cwd=tmp_path)
    said = call("run", PIPELINES / "skirt.yaml", "--recording", recording, "--frames", "0:4", "--out", "out",
                cwd=tmp_path)  # fmt: skip
    assert "track: 4 of 4 frames" in said and (tmp_path / "outfit.png").exists()
    assert len(table(tmp_path / "out/results/angles.csv")["frame"]) == 4


def knees_of_a_template(recording, folder, *words):
    """How far a template's knees are off in the first frames, at most.

    Its joint centres lie elsewhere in the body than those of the truth: constant differences are left out.
    """
    files = ("--recording", recording, "--out", "out", *NO_PICTURES)
    said = call("run", PIPELINES / "unscanned.yaml", "--frames", "0:20", *files, *words, cwd=folder)
    assert "proportions: girth " in said
    with (folder / "out/results/evaluation.csv").open(newline="", encoding="utf-8") as lines:
        rows = {row["angle"]: float(row["rms_without_offset_deg"]) for row in csv.DictReader(lines)}
    return max(rows["knee_flexion_l"], rows["knee_flexion_r"])


def without_a_scan(clip, recording, *files):
    """A copy of a clip without what a scanner and somebody who knows the first pose would give, and without files."""
    scan = ("body.obj", "weights.npz", "skeleton.json", "init.json")
    shutil.copytree(clip, recording, ignore=shutil.ignore_patterns(*scan, *files))
    return recording


@long
@pytest.mark.parametrize("clip", CLIPS)
def test_a_template_tracks_somebody_of_whom_there_are_only_videos_plates_and_tape_measures(tmp_path, clip):
    recording = without_a_scan(CLIPS[clip], tmp_path / "recording")
    assert knees_of_a_template(recording, tmp_path) < 3.0


@long
@pytest.mark.parametrize("clip", CLIPS)
def test_a_template_tracks_somebody_by_keypoints_and_tape_measures_without_plates(tmp_path, clip):
    recording = without_a_scan(CLIPS[clip], tmp_path / "recording", "background")
    write_true_keypoints(CLIPS[clip], recording / "keypoints")
    assert knees_of_a_template(recording, tmp_path, "--set", "stages.start=start_from_keypoints") < 3.0


def test_every_pipeline_is_run_here_that_needs_no_extra_and_has_a_recording(tmp_path):
    files = {path.stem for path in PIPELINES.glob("*.yaml") if "\nfactors:" not in path.read_text()}
    assert files == {*CLIPS, "demo", *OTHERS, *UNSHIPPED, "skirt_xpbd", "unscanned"}
    for pipeline in UNSHIPPED:
        assert "--recording" in call("plan", PIPELINES / f"{pipeline}.yaml", cwd=tmp_path, status=2)


@pytest.fixture
def grid(tmp_path):
    """An experiment of two variants on two recordings, twenty frames each."""
    (tmp_path / "grid.yaml").write_text(
        f"mocapflow: 1\npipeline: {PIPELINES / 'bare.yaml'}\nrecordings: [{CLIPS['skirt']}, {CLIPS['shorts']}]\n"
        "frames: 0:20\nchange: {stages.overlay: null, stages.virtual: null, stages.report: null}\n"
        "factors:\n  turns:\n    three:\n    one: {stages.track.steady.max_turns: 1}\n"
    )
    return "grid.yaml"


@long
def test_an_experiment_on_two_workers_shares_what_its_variants_share(tmp_path, grid):
    said = call("compare", grid, "--workers", "2", "--out", "two", cwd=tmp_path)
    computed = [line for line in said.splitlines() if "computed:" in line]
    assert len(computed) == 4
    assert sum("background" in line for line in computed) == 2  # once a recording, whoever came first
    call("compare", grid, "--out", "one", "--store", "fresh.zarr", cwd=tmp_path)
    assert (tmp_path / "two/compare.csv").read_text() == (tmp_path / "one/compare.csv").read_text()


@long
def test_a_lost_worker_costs_only_the_frame_in_flight(tmp_path, grid):
    import psutil

    call("compare", grid, "--out", "one", "--store", "fresh.zarr", cwd=tmp_path)
    command = [MOCAPFLOW, "compare", grid, "--workers", "2", "--out", "two"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        said = []
        for line in running.stderr:
            said.append(line)
            if line.startswith("track: running"):
                break
        time.sleep(1)  # by then some frames are saved, and not yet all
        children = psutil.Process(running.pid).children(recursive=True)
        max(children, key=lambda process: process.cpu_times().user).kill()  # one that works
        said += list(running.stderr)
    assert running.returncode == 0, "".join(said)
    assert (tmp_path / "two/compare.csv").read_text() == (tmp_path / "one/compare.csv").read_text()
