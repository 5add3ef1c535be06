import errno
import io
import json
import logging
import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import cv2
import mocapflow_draping
import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned
from mocapflow_draping.kinematic import Kinematic
from mocapflow_evaluation import evaluate
from mocapflow_export import layout, tables
from mocapflow_export.export import WriteFormats
from mocapflow_garments.skirt import Skirt
from typer.testing import CliRunner

from mocapflow import cli, load_registry, registry
from mocapflow.commands import cache, pictures, results
from mocapflow.commands.invocation import FILE, Invocation, remember
from mocapflow.commands.progress import reporter
from mocapflow.help.shipped import shipped
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.io.motion.trc import write_trc
from mocapflow.recordings import doctor
from mocapflow.results import Evaluation
from mocapflow.running import runner
from mocapflow.storage.locks import myself
from tests.fixtures.stores import STAGES, write_pipeline, write_recording

CLIP = shipped("examples", "data", "skirt_steps")


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("start.yaml").write_text(f"recording: {CLIP}\nstages:\n  start: start_from_file\n")

    def invoke(*words):
        monkeypatch.setattr(sys, "argv", ["mocapflow", *words])
        return CliRunner().invoke(cli.app, words, prog_name="mocapflow")

    return invoke


def test_an_error_about_what_nobody_can_print_is_printed(call):
    done = call("plan", "\udcff.yaml")
    assert done.exit_code == 2 and done.stderr.startswith("error: \\udcff.yaml  there is no such file")


def test_a_terminal_whose_encoding_lacks_a_letter_shows_its_number():
    words = [sys.executable, "-m", "mocapflow", "show", "stage", "coupled_loop"]
    done = subprocess.run(words, env={**os.environ, "PYTHONIOENCODING": "latin-1"}, capture_output=True, check=True)
    assert rb"int (\u2265 2000) = 12000" in done.stdout


def test_a_run_is_made_once_and_then_found(call):
    first = call("run", "start.yaml")
    assert first.exit_code == 0, first.output
    assert "results: runs/start" in first.stdout
    assert "start: running start_from_file" in first.stderr
    assert "start: from the store" in call("run", "start.yaml").stderr
    assert "start: running" in call("run", "start.yaml", "--fresh").stderr
    assert " hit " in call("plan", "start.yaml").stdout
    told = call("status", "runs/start").stdout.splitlines()
    assert " hit " in told[0] and told[-1].startswith("finished at 20")
    assert " run " in call("plan", "start.yaml", "--store", "elsewhere.zarr").stdout


@pytest.mark.parametrize("more", [[], ["--workers", "2"]])
def test_a_run_folder_within_the_recording_is_refused_before_it_is_made(call, tmp_path, more):
    write_pipeline(tmp_path, write_recording(tmp_path / "clip"))
    (tmp_path / "clip" / "videos").mkdir(exist_ok=True)
    refused = call("run", str(tmp_path / "tiny.yaml"), "--out", "clip/videos/run", *more)
    assert refused.exit_code == 2
    assert "give results a folder of their own: --out runs/clip" in refused.stderr
    assert not Path("clip/videos/run").exists()
    stored = call("run", str(tmp_path / "tiny.yaml"), "--out", "run", "--store", "clip/videos", *more)
    assert stored.exit_code == 2 and "the stored results would lie among the files" in stored.stderr


@pytest.mark.parametrize(
    ("stages", "lost", "message"),
    [
        ("{start: start_from_file}", "init.json", "there is no file with the first pose"),
        ("{start: start_from_file}", "subject/body.obj", "no such mesh"),
        ("{start: start_from_file}", "subject/skeleton.json", "there is no skeleton for the mesh"),
        ("{start: start_from_file}", "videos/cam02.mp4", "missing camera: no video of cam02"),
        ("{start: start_from_file}", "cameras.toml", "no calibration file"),
        ("{start: start_from_keypoints}", "none", "there are no 2D keypoints of two cameras or more"),
        (
            "{start: start_from_file, track: {use: coupled_loop, predictor: hold, segmenter: levelset, "
            "matchers: [keypoints], pose_solver: twist_gauss_newton}}",
            "none",
            "there are no 2D keypoints\n",
        ),
        ("{turned: align_cameras}", "none", "there are no 2D keypoints of two cameras or more"),
        ("{body: {use: fit_subject, trial: static}}", "none", "there is no standing trial"),
        ("{room: {use: background, source: plates}}", "background", "there are no clean plates"),
        ("{room: background}", "background/cam03.png", "no clean plate of cam03"),
    ],
)
@pytest.mark.long
def test_a_plan_tells_what_is_missing_as_a_run_does_before_it_begins(call, tmp_path, stages, lost, message):
    shutil.copytree(CLIP, tmp_path / "clip")
    shutil.rmtree(tmp_path / "clip/keypoints", ignore_errors=True)
    place = tmp_path / "clip" / lost
    if place.exists():
        shutil.rmtree(place) if place.is_dir() else place.unlink()
    Path("start.yaml").write_text(f"recording: clip\nstages: {stages}\n")
    planned, done = call("plan", "start.yaml"), call("run", "start.yaml")
    assert planned.exit_code == done.exit_code == 2, planned.output + done.output
    assert message in planned.stderr and planned.stdout == ""
    assert done.stderr == planned.stderr
    assert not Path("runs/store.zarr").exists()


@pytest.mark.parametrize("file", ["init.json", "subject/skeleton.json"])
def test_a_plan_refuses_a_file_that_a_run_would_refuse(call, tmp_path, file):
    shutil.copytree(CLIP, tmp_path / "clip")
    Path("start.yaml").write_text("recording: clip\nstages: {start: start_from_file}\n")
    (tmp_path / "clip" / file).write_text("{")
    planned, done = call("plan", "start.yaml"), call("run", "start.yaml")
    assert planned.exit_code == done.exit_code == 2, planned.output + done.output
    assert planned.stderr == done.stderr
    assert planned.stderr.startswith(f"error: clip/{file}:1:2  not JSON: ")
    assert planned.stdout == ""


def test_a_reference_that_is_missing_is_told_before_anything_is_tracked(call):
    bare, change = str(shipped("pipelines", "bare.yaml")), "stages.evaluate.reference=truth/no.csv"
    planned = call("plan", bare, "--recording", str(CLIP), "--set", change)
    assert planned.exit_code == 2 and "truth/no.csv  no such reference" in planned.stderr


def test_what_comes_from_the_store_needs_no_files(call, tmp_path):
    shutil.copytree(CLIP, tmp_path / "clip")
    Path("start.yaml").write_text("recording: clip\nstages: {checked: check_views}\n")
    assert call("run", "start.yaml", "--frames", "0:2").exit_code == 0
    shutil.rmtree(tmp_path / "clip/subject")  # which nobody reads
    assert call("plan", "start.yaml", "--frames", "0:2").exit_code == 0


def test_the_store(call):
    call("run", "start.yaml", "--out", "first/run")
    assert Path("first/store.zarr").is_dir()
    store = ("--store", "first/store.zarr")
    listed = call("cache", "list", *store).stdout
    name = listed.split()[0]
    assert name.startswith("start-")
    assert "complete" in listed
    explained = json.loads(call("cache", "explain", name, *store).stdout)
    assert explained["component"]["name"] == "start_from_file"
    assert json.loads(call("cache", "explain", name[:-6], *store).stdout) == explained
    assert call("cache", "explain", name, name, *store).stdout == "made from the same\n"
    assert f"would remove {name}" in call("cache", "prune", "--all", "--dry-run", *store).stdout
    assert "0 results" in call("cache", "prune", "--days", "1", *store).stdout
    damaged = Path("first/store.zarr/.state/damaged-start-0")
    damaged.mkdir()
    cut = Path("first/store.zarr/smooth-0123456789ab")
    cut.mkdir()
    (cut / "zarr.json").write_text('{"attributes": {"key')
    told = call("cache", "list", *store).stdout.splitlines()
    assert [line.split()[:2] for line in told[-2:]] == [[cut.name, "damaged;"], [damaged.name, "damaged;"]]
    pruned = call("cache", "prune", "--all", *store).stdout
    assert f"removed {name}" in pruned and f"removed {damaged.name}" in pruned
    assert not damaged.exists() and not cut.exists()
    assert call("cache", "list", *store).stdout == ""


def test_a_result_that_was_cut_off_is_found_when_it_is_read(call, tmp_path):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", 3))
    assert call("run", path.name, "--store", "store.zarr").exit_code == 0
    (chunk,) = Path("store.zarr").glob("track-*/angles/c.0.0")
    chunk.write_bytes(chunk.read_bytes()[:-5])
    listed = ("cache", "list", "--store", "store.zarr")
    assert "damaged" not in call(*listed).stdout
    (told,) = [line for line in call(*listed, "--check").stdout.splitlines() if "damaged" in line]
    assert told.startswith("track-") and "can't be read back" in told
    shutil.rmtree(next(Path("store.zarr").glob("smooth-*")))  # so that somebody reads the track
    mended = call("run", path.name, "--store", "store.zarr")
    assert mended.exit_code == 0 and "is damaged and written anew from its frames" in mended.stderr
    assert "damaged" not in call(*listed, "--check").stdout


def test_what_a_run_is_writing_is_not_pruned(call, monkeypatch):
    call("run", "start.yaml", "--store", "store.zarr")
    name = call("cache", "list", "--store", "store.zarr").stdout.split()[0]
    lock = Path("store.zarr/.state", f"{name.partition('-')[2]}.lock")
    prune = ("cache", "prune", "--all", "--store", "store.zarr")
    lock.write_text(json.dumps(myself()))
    assert f"kept {name}: a run is writing it" in call(*prune).output
    lock.write_text(json.dumps({**myself(), "pid": 2**22 + 1}))  # it was killed
    with monkeypatch.context() as patch:  # sizes take long, and meanwhile a run begins
        patch.setattr(cache, "_size", lambda path: lock.write_text(json.dumps(myself())))
        assert f"kept {name}: a run is writing it" in call(*prune).output
    lock.unlink()
    assert "kept" not in call(*prune, "--dry-run").output
    assert f"removed {name}" in call(*prune).stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("new", "plugin", "mine", "--out", "start.yaml/mine"),
         "error: start.yaml/mine/pyproject.toml  can't be written: Not a directory\n"
         "       name another folder with --out\n"),
        (("plan", "start.yaml", "--frames", "0:6:0"),
         "error: --frames 0:6:0  frames.step: input should be greater than 0, not 0\n"),
        (("run", "stert.yaml"), "error: stert.yaml  there is no such file\n"
         "       available: start.yaml — did you mean 'start.yaml'?\n"),
        (("run", "start.yaml", "--set", "stages.start.tilt=3"),
         "error: --set stages.start.tilt=3  stages.start.tilt: unknown setting of start_from_file (file)\n"),
        (("plan", "start.yaml", "--frames", "3"),
         "error: --frames 3  frames are written A:B or A:B:STEP; either end may be left out\n"),
        (("plan", "start.yaml", "--recording", "nowhere"),
         "error: nowhere  there is no such folder\n       --recording DIR names another\n"),
        (("status", "nowhere"), "error: nowhere  this is no run folder\n"
         "       a run folder is what `mocapflow run` writes; it holds command.json\n"),
        (("evaluate", "nowhere"), "error: nowhere  this is no run folder\n"
         "       a run folder is what `mocapflow run` writes; it holds command.json\n"),
        (("status", "start.yaml"), "error: start.yaml  this is no run folder\n"
         "       a run folder is what `mocapflow run` writes; it holds command.json\n"),
        (("compare", "start.yaml"), "error: start.yaml  this is a pipeline, no experiment\n"
         "       `mocapflow run` runs one; an experiment names it, as `pipeline: FILE`\n"),
    ],
)  # fmt: skip
def test_what_the_user_can_mend_ends_with_2(call, words, message):
    result = call(*words)
    assert result.stderr == message
    assert result.exit_code == 2
    assert result.stdout == ""


@pytest.mark.parametrize("damage", [lambda path: path.mkdir(), lambda path: path.write_text("[]")])
@pytest.mark.parametrize("words", [("status",), ("evaluate",), ("export", "--format", "csv")])
def test_a_run_folder_whose_command_is_damaged(call, words, damage):
    Path("out").mkdir()
    damage(Path("out/command.json"))
    told = call(words[0], "out", *words[1:])
    assert told.exit_code == 2
    assert told.stderr == "error: out/command.json  this file is damaged\n       run the pipeline again\n"


@pytest.mark.parametrize("days", ["nan", "-1"])
def test_days_that_are_no_age_prune_nothing(call, days):
    call("run", "start.yaml")
    assert "a number of days" in call("cache", "prune", "--days", days).stderr
    assert call("cache", "list").stdout.startswith("start-")
    assert "0 results" in call("cache", "prune", "--days", "inf").stdout


@pytest.mark.parametrize("words", [["--out", ""], ["--out="], ["--recording", ""]])
def test_an_empty_path_is_not_the_working_directory(call, words):
    done = call("run", "start.yaml", *words)
    assert done.exit_code == 2 and f"nothing stands behind {words[0]}; is a shell variable not set?" in done.stderr
    assert [path.name for path in Path().iterdir()] == ["start.yaml"]


def test_a_run_that_does_not_begin_leaves_no_folder(call):
    assert call("run", "start.yaml", "--frames", "90:100").exit_code == 2
    assert not Path("runs/start").exists()


def test_an_export_into_a_folder_that_may_not_be_written(call, tmp_path, monkeypatch):
    def refused(self, result, run_folder):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(run_folder.path / "results"))

    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", 3), stages={**STAGES, "export": "export"})
    assert call("run", path.name, "--out", "out").exit_code == 0
    monkeypatch.setattr(WriteFormats, "write", refused)
    told = call("export", "out", "--format", "trc")
    assert told.stderr.endswith("error: out/results  can't be written or read: Permission denied\n")
    assert told.exit_code == 1


def test_a_run_that_fails_is_not_said_to_be_finished(call, monkeypatch):
    def fails(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "run.json")

    assert call("run", "start.yaml").exit_code == 0
    monkeypatch.setattr(runner.Prepared, "run", fails)
    assert call("run", "start.yaml").exit_code == 1
    assert "finished" not in call("status", "runs/start").stdout


def test_a_plugin_that_leaves_the_program_is_no_success(call, monkeypatch):
    def leaves(*_):
        raise SystemExit(0)

    monkeypatch.setattr(Skirt, "sew", leaves)
    shown = call("show", "garment", "skirt", "--recording", str(CLIP), "--out", "skirt.png")
    assert shown.exit_code == 1 and "failed: it left with status 0\n" in shown.stderr
    found = call("doctor", str(CLIP))
    assert found.exit_code == 2 and "skirt can't be sewn: it left with status 0" in found.stdout
    monkeypatch.setattr(doctor, "examine", leaves)
    assert str(call("doctor", str(CLIP)).exception) == "a plugin or a library left the program"


def test_a_viewer_that_can_not_open_is_told(call, monkeypatch):
    monkeypatch.setattr(results, "export", lambda *_: None)
    monkeypatch.setattr(sys, "executable", "false")
    shown = call("view", "out")
    assert shown.exit_code == 2
    assert shown.stderr == (
        "error: out/results/scene.rrd  the viewer ended with status 1\n"
        "       it needs a display; --no-show only writes this file, which `rerun` opens anywhere\n"
    )


def test_a_prior_that_can_not_be_written(call):
    angles = str(CLIP / "truth/angles.csv")
    made = call("prior", "fit", angles, "--out", "start.yaml/new/mine.npz")
    assert made.exit_code == 1
    assert made.stderr == (
        "error: start.yaml/new/mine.npz  can't be written: Not a directory\n"
        "       --out names a .npz, in a folder that may be written\n"
    )
    assert call("prior", "fit", angles, "--out", "new/mine.npz").exit_code == 0 and Path("new/mine.npz").is_file()


def test_a_store_that_is_not_there_ends_with_2(call):
    result = call("cache", "list")
    assert result.stderr.startswith("error: runs/store.zarr  there is no store here\n       a store is what ")
    assert result.exit_code == 2
    assert "not s3://mine/store.zarr\n" in call("cache", "list", "--store", "s3://mine/store.zarr").stderr


@pytest.mark.parametrize("more", [[], ["--all"]])
def test_a_folder_that_is_no_store_is_not_pruned(call, more):
    mine = Path("runs/my-run/results")
    mine.mkdir(parents=True)
    refused = call("cache", "prune", "--store", "runs", *more)
    assert refused.exit_code == 2 and "runs  there is no store here" in refused.stderr
    assert mine.is_dir()


def test_a_run_folder_within_a_store_is_no_damaged_result(call):
    call("run", "start.yaml", "--store", "kept", "--out", "kept/my-run")
    assert "damaged" not in call("cache", "list", "--store", "kept").stdout
    assert "1 results" in call("cache", "prune", "--all", "--store", "kept").stdout
    assert Path("kept/my-run/command.json").is_file()


def test_the_version_is_that_of_the_package(call):
    assert call("--version").stdout == f"mocapflow {version('mocapflow')}\n"


def test_two_components_of_one_name_are_listed_with_a_note(call, monkeypatch):
    doubled = ModuleType("doubled")
    doubled.mocapflow_drapers = mocapflow_draping.mocapflow_drapers

    def twice():
        found = load_registry()
        found.add(registry.Origin("mine", "my-drapers", "0.1"), lambda: doubled)
        return found

    monkeypatch.setattr("mocapflow.registry.load_registry", twice)
    said = call("plugins")
    assert said.exit_code == 0
    assert "provide a draper 'kinematic': no pipeline can name it" in said.stderr
    assert "my-drapers 0.1" in said.stderr


def test_an_interrupt_ends_with_130_and_says_how_to_go_on(call, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner.Prepared, "run", stopped)
    result = call("run", "start.yaml", "--set", "frames={start: 1}")
    assert result.exit_code == 130
    assert result.stderr == (
        "\ninterrupted; what is finished is saved. To go on: mocapflow run start.yaml --set 'frames={start: 1}'\n"
    )
    assert call("run", "start.yaml", "--fresh").stderr.endswith("To go on: mocapflow run start.yaml\n")


def test_an_interrupted_command_that_saves_nothing_does_not_say_so(call, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(doctor, "examine", stopped)
    result = call("doctor", ".")
    assert (result.exit_code, result.stderr) == (130, "\ninterrupted\n")


def test_a_library_that_leaves_when_it_is_interrupted_was_interrupted(call, monkeypatch):
    def leaves(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            sys.exit(1)

    monkeypatch.setattr(doctor, "examine", leaves)
    assert call("doctor", ".").exit_code == 130


def test_no_place_for_compiled_code_is_told(call, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("cannot cache function '_chain': no locator available for file '/usr/kinematics.py'")

    monkeypatch.setattr(runner.Prepared, "run", broken)
    result = call("run", "start.yaml")
    assert result.exit_code == 2
    assert result.stderr.endswith("NUMBA_CACHE_DIR names a folder of yours for it\n")


def test_a_bug_shows_its_traceback(call, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(runner.Prepared, "run", broken)
    assert isinstance(call("run", "start.yaml").exception, ZeroDivisionError)


def test_the_demo_runs_what_is_shipped_from_any_folder(call, monkeypatch):
    ran = []
    monkeypatch.setattr(runner.Prepared, "run", lambda prepared, out, **options: ran.append((prepared, out)))
    result = call("demo")
    assert result.stdout == "overlay videos  runs/demo/overlay\njoint angles    runs/demo/results/angles.csv\n"
    prepared, out = ran[0]
    assert prepared.pipeline.recording == CLIP
    assert out == Path("runs/demo")
    assert prepared.store.path == Path("runs/store.zarr")
    assert {"export", "overlay"} <= {named.label for named in prepared.pipeline.stages}


def test_a_full_drive_is_told_and_a_bug_shows_itself(call, monkeypatch):
    def fails(*_, **__):
        raise OSError(number, os.strerror(number), "run.json")

    monkeypatch.setattr(runner.Prepared, "run", fails)
    number = errno.ENOSPC
    full = call("run", "start.yaml")
    assert full.exit_code == 1
    assert full.stderr.startswith("error: run.json  can't be written or read: No space left on device\n")
    number = errno.ENOTTY
    assert isinstance(call("run", "start.yaml").exception, OSError)


@pytest.mark.long
def test_a_run_is_evaluated_and_exported(call):
    assert call("run", str(shipped("pipelines", "bare.yaml")), "--frames", "0:2").exit_code == 0
    assert len(Path("runs/bare/results/angles.csv").read_text().splitlines()) == 3
    evaluated = call("evaluate", "runs/bare").stdout.splitlines()
    assert evaluated[1].split() == ["angle", "frames", "rms_deg", "mae_deg", "offset_deg", "max_deg", "worst_frame"]
    assert evaluated[2].split()[:2] == ["knee_flexion_l", "2"]
    Path("runs/bare/results/joints.trc").unlink()
    exported = call("export", "runs/bare", "--format", "trc")
    assert "track: from the store" in exported.stderr
    assert "overlay" not in exported.stderr
    assert Path("runs/bare/results/joints.trc").exists()


def test_what_the_pipeline_compares_with_is_compared_with_again(call, tmp_path):
    changes = ("stages.evaluate.reference=truth",)  # a folder
    remember(Invocation(str(shipped("pipelines", "bare.yaml")), str(CLIP), changes, None, "store"), tmp_path, {})
    missing = call("evaluate", str(tmp_path))
    assert missing.stderr.startswith(f"error: {CLIP / 'truth'}  there is nothing to compare with\n")
    assert "keypoints are compared in a run: run its pipeline again\n" in missing.stderr
    given = call("evaluate", str(tmp_path), "--truth", str(CLIP))
    assert "--set stages.evaluate.reference=keypoints" in given.stderr
    ours = {"frame": np.arange(9.0), "time": np.arange(9) / 30, "knee_flexion_l": np.arange(9.0)}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), ours)
    lost = call("evaluate", str(tmp_path), "--truth", "nowhere.csv")
    assert (lost.exit_code, lost.stderr) == (2, "error: nowhere.csv  no such reference\n")
    joints = np.random.default_rng(0).uniform(size=(9, 3, 3))
    write_trc(tmp_path / layout.KEYPOINTS, ["hip_l", "knee_l", "ankle_l"], joints, 30.0)
    again = call("evaluate", str(tmp_path))
    assert again.stdout.startswith(f"compared with {tmp_path / layout.KEYPOINTS}\n"), again.output


def test_a_comparison_waits_for_a_run_that_writes_into_the_folder(call, tmp_path, monkeypatch):
    held = []

    @contextmanager
    def holding(out):
        held.append(out)
        yield
        held.clear()

    def compared(run, *_):
        assert held == [run]
        return Evaluation(reference="", rows=(), notes=("looked at",))

    monkeypatch.setattr(results, "alone", holding)
    monkeypatch.setattr(evaluate, "evaluate_run", compared)
    assert "looked at" in call("evaluate", str(tmp_path), "--truth", "known.csv").stderr
    lost = call("evaluate", "nowhere", "--truth", "known.csv")
    assert lost.exit_code == 2 and "nowhere  this is no run folder" in lost.stderr
    assert not Path("nowhere").exists()


def test_an_export_leaves_what_the_run_folder_remembers(call, tmp_path):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", 3), stages={**STAGES, "export": "export"})
    assert call("run", path.name, "--out", "out", "--set", "stages.note=tiny_export").exit_code == 0
    before = Path("out", FILE).read_text()
    exported = call("export", "out", "--format", "trc", "--format", "bvh")
    assert exported.exit_code == 0, exported.output
    files = [Path("out/results/joints.trc"), Path("out/results/motion.bvh")]
    assert exported.stdout.splitlines()[-2:] == list(map(str, files)) and all(file.is_file() for file in files)
    assert "track: from the store" in exported.stderr and "note: " not in exported.stderr
    assert Path("out", FILE).read_text() == before
    assert "\nnote " in call("status", "out").stdout
    unknown = call("export", "out", "--format", "trc", "--format", "gtlf")
    assert unknown.exit_code == 2 and unknown.stderr == (
        "error: --format gtlf  there is no such format\n"
        "       available: bvh, c3d, csv, gltf, mot, movement, parquet, rrd, trc, usd — did you mean 'gltf'?\n"
    )


def test_paths_of_changes_start_where_the_run_was_begun(call, tmp_path, monkeypatch):
    (tmp_path / "clip").symlink_to(CLIP)
    Path("start.yaml").write_text("stages:\n  start: start_from_file\n")
    assert call("run", "start.yaml", "--set", "recording=clip", "--out", "out").exit_code == 0
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert " hit " in call("status", "../out").stdout


@pytest.mark.parametrize("truth", [[], ["--truth", str(CLIP / "truth/angles.csv")]])
@pytest.mark.long
def test_a_comparison_is_made_as_in_the_run(call, tmp_path, truth):
    known = read_columns(CLIP / "truth/angles.csv")
    late = {name: np.roll(column, 8) if name != "frame" else column for name, column in known.items()}
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), {**late, "time": known["frame"] / 30})
    lags = []
    for longest in (0.4, 0.1):  # s
        changes = (f"stages.evaluate.longest_lag_s={longest}",)
        remember(Invocation(str(shipped("pipelines", "bare.yaml")), str(CLIP), changes, None, "store"), tmp_path, {})
        assert call("evaluate", str(tmp_path), *truth).exit_code == 0
        lags.append(json.loads(layout.place(tmp_path, layout.FINDINGS).read_text())["lag_frames"])
    assert lags[0] == pytest.approx(8, abs=0.5)
    assert lags[1] is None  # none is found so near


@pytest.mark.long
def test_a_run_folder_from_elsewhere_is_compared_with_what_is_given(call, tmp_path):
    known = read_columns(CLIP / "truth/angles.csv")
    tables.write_columns(layout.place(tmp_path, layout.ANGLES), {**known, "time": known["frame"] / 30})
    remember(Invocation("/elsewhere/bare.yaml", None, (), None, "store"), tmp_path, {})
    assert call("evaluate", str(tmp_path)).stderr.startswith("error: /elsewhere/bare.yaml  there is no such file")
    compared = call("evaluate", str(tmp_path), "--truth", str(CLIP / "truth/angles.csv"))
    assert compared.exit_code == 0
    assert compared.stderr.startswith("warning: compared by the default settings, as those of the run can't be read")


def test_plugins(call):
    result = call("plugins")
    assert "priors  (mocapflow 0.1.0)\n  predictor:    constant_acceleration, constant_velocity, hold" in result.stdout
    assert result.stderr == ""


@pytest.mark.parametrize("command", ["plugins", "settings"])
def test_a_plugin_that_does_not_load_is_told(call, tmp_path, monkeypatch, command):
    broken = registry.load_registry([tmp_path / "nowhere.py"])
    monkeypatch.setattr(registry, "load_registry", lambda: broken)
    result = call(command)
    assert result.exit_code == 0
    assert result.stderr.startswith("note: ")
    assert "nowhere.py" in result.stderr


def test_settings(call):
    said = call("settings", "mocapflow").stdout
    assert "| `steady.turns` | `int (> 0)` | `2` | | in a row within the tolerances" in said
    other = call("settings", "mocapflo")
    assert (other.exit_code, other.stdout) == (2, "")
    assert "available: mocapflow — did you mean 'mocapflow'?" in other.stderr


@pytest.mark.parametrize(("command", "default"), [("run", "runs/NAME_OF_PIPELINE"), ("show", "runs/NAME.png")])
def test_help_says_where_files_go_by_default(call, command, default):
    assert f"[default: ({default})]" in call(command, "--help").stdout


def test_show(call):
    shown = call("show", "prior", "joint_limits").stdout
    assert shown.startswith("prior joint_limits, from plugin 'priors' (mocapflow 0.1.0)\nA soft wall at the limits")
    assert "  sd_deg  float (> 0) = 2.0  # standard deviation of an angle beyond its limits\n" in shown
    missing = call("show", "prior", "joint_limit")
    assert missing.exit_code == 2
    assert missing.stderr.startswith("error: no prior named 'joint_limit'\n       available: ")
    assert missing.stderr.endswith("did you mean 'joint_limits'?\n")


@pytest.mark.parametrize("words", [(), ("run",), ("cache", "list")])
def test_help_has_a_short_name(call, words):
    assert call(*words, "-h").stdout == call(*words, "--help").stdout != ""


def test_equations(call):
    shown = call("equations", "12.8").stdout
    assert shown.split()[:3] == ["12.8", "kinematic", "chain"]
    assert "geometry/kinematics.py:" in shown
    assert "no equation, title or function has 'twelve' in it" in call("equations", "twelve").output


def test_doctor(call):
    good = call("doctor", str(CLIP))
    assert (good.exit_code, good.stdout) == (0, f"{CLIP}: nothing to mend\n")
    bad = call("doctor", "nowhere")
    assert (bad.exit_code, bad.stdout) == (2, "error: nowhere  no such recording folder\n")


def test_progress_is_plain_lines_unless_on_a_terminal(capsys):
    class Terminal:
        written = ""

        def isatty(self):
            return True

        def write(self, text):
            self.written += text

        def flush(self):
            pass

    with reporter() as show:
        show("track: 3 of 6 frames, at rest after 2 turns")
    assert capsys.readouterr().err == "track: 3 of 6 frames, at rest after 2 turns\n"
    terminal = Terminal()
    with reporter(terminal) as show:
        show("track: 3 of 6 frames, at rest after 2 turns")
        show("smooth: running")
    assert terminal.written == (
        f"\r\x1b[Ktrack: {'█' * 15}{'·' * 15} 3 of 6 frames, at rest after 2 turns\nsmooth: running\n"
    )


def test_a_bar_fits_the_terminal_and_what_comes_after_it_begins_a_line(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("COLUMNS", "60")
    terminal = Terminal()
    with pytest.raises(KeyError), reporter(terminal) as show:
        show("track: 3 of 6 frames, 12:30 left, at rest after 2 turns")
        raise KeyError
    line, rest = terminal.getvalue().removeprefix("\r\x1b[K").split("\n")
    assert len(line) < 60 and line.startswith("track: █") and rest == ""


def test_what_is_logged_while_a_bar_is_open_begins_a_line(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    ours, root = logging.getLogger("mocapflow"), logging.getLogger()
    for logger in (ours, root):
        monkeypatch.setattr(logger, "handlers", [])
    monkeypatch.setattr(sys, "stderr", terminal)
    level = ours.level
    try:
        cli._tell_on_stderr()
        with reporter() as show:
            for log in (ours.info, logging.getLogger("of_a_library").warning, cli._show_warning, ours.debug):
                show("track: 3 of 6 frames, at rest after 2 turns")
                log("dark")
    finally:
        ours.setLevel(level)
    lines = terminal.getvalue().split("\n")
    assert [line for line in lines if "dark" in line] == ["dark", "warning: dark", "warning: dark"]
    assert len(lines) == 8 and not any(handler.filters for handler in root.handlers)


@pytest.mark.parametrize("garment", ["skirt", "shorts", "cylinder"])
@pytest.mark.long
def test_a_garment_is_drawn(call, garment):
    shown = call("show", "garment", garment, "--out", "garment.png")
    assert shown.exit_code == 0, shown.output
    assert "vertices in" in shown.stdout
    image = cv2.imread("garment.png")
    cloth = (image[..., 0] > 1.5 * image[..., 2]) & (image[..., 0] > 60)  # blue
    panels = np.array([panel.mean() for panel in np.hsplit(cloth, 5)])
    assert (panels > 0.004).all(), panels


def test_a_garment_is_drawn_on_the_template_where_there_is_no_scan(call, monkeypatch, tmp_path):
    monkeypatch.setattr(pictures, "poster", lambda *_: np.zeros((8, 8, 3), np.uint8))
    (tmp_path / "subject").mkdir()
    shutil.copy(shipped("examples", "data", "skirt_steps") / "subject" / "garment.json", tmp_path / "subject")
    shown = call("show", "garment", "skirt", "--recording", str(tmp_path))
    assert "sewn on the template: " in shown.stdout


def test_a_garment_is_drawn_without_being_asked_to(call, monkeypatch):
    monkeypatch.setattr(pictures, "poster", lambda *_: np.zeros((8, 8, 3), np.uint8))  # which takes two seconds to draw
    shown = call("show", "garment", "skirt")
    assert shown.stdout.splitlines()[-1].endswith("picture: runs/skirt.png") and "length_m" in shown.stdout
    assert cv2.imread("runs/skirt.png").shape == (8, 8, 3)
    assert (
        call("show", "garment", "skirt", "--draper", "kinematik")
        .stdout.splitlines()[-2]
        .startswith("no picture: show garment skirt  no draper named 'kinematik'")
    )


def test_a_garment_or_a_body_that_a_run_would_refuse_is_not_drawn(call, monkeypatch):
    sew, load_body = Skirt.sew, Scanned.load
    with monkeypatch.context() as patch:
        patch.setattr(Skirt, "sew", lambda self, body: replace(m := sew(self, body), vertices=m.vertices + 5))
        refused = call("show", "garment", "skirt", "--out", "garment.png")
        assert refused.exit_code == 1 and "error: garment 'skirt' (" in refused.stderr
        assert "failed: it returned a pin 8" in refused.stderr
    monkeypatch.setattr(
        Scanned, "load", lambda self, folder: replace(b := load_body(self, folder), vertices=b.vertices * np.nan)
    )
    refused = call("show", "garment", "skirt", "--out", "garment.png")
    assert refused.exit_code == 1 and "error: body 'scanned' (" in refused.stderr
    assert "failed: it returned vertices that are not finite" in refused.stderr


@pytest.mark.parametrize(("cls", "verb"), [(Skirt, "sew"), (Kinematic, "drape")])
def test_a_garment_or_a_draper_that_raises_is_told(call, monkeypatch, cls, verb):
    def torn(self, *_):
        raise ValueError("torn")

    monkeypatch.setattr(cls, verb, torn)
    shown = call("show", "garment", "skirt", "--out", "new/garment.png")
    assert shown.exit_code == 1
    assert shown.stderr.startswith(f"error: {cls.role} '{cls.name}' (plugin '")
    assert shown.stderr.endswith("failed: ValueError: torn\n       traceback: new/garment.log\n")
    assert "in torn" in Path("new/garment.log").read_text()
    quiet = call("show", "garment", "skirt")
    assert quiet.exit_code == 0 and f"no picture: {cls.role} '{cls.name}'" in quiet.stdout


@pytest.mark.parametrize("out", ["start.yaml/skirt.png", "skirt.doc"])
def test_a_picture_that_can_not_be_written(call, monkeypatch, out):
    monkeypatch.setattr(pictures, "poster", lambda *_: np.zeros((8, 8, 3), np.uint8))  # which takes two seconds to draw
    shown = call("show", "garment", "skirt", "--out", out)
    assert shown.exit_code == 1
    assert f"error: {out}  the picture can't be written" in shown.stderr


def test_a_picture_makes_its_folder_and_asks_for_that_of_the_recording(call, monkeypatch):
    monkeypatch.setattr(pictures, "poster", lambda *_: np.zeros((8, 8, 3), np.uint8))  # which takes two seconds to draw
    show = ("show", "garment", "skirt", "--out", "new/skirt.png")
    lost = call(*show, "--recording", "nowhere")
    assert (lost.exit_code, lost.stderr) == (2, "error: nowhere  no such recording folder\n")
    assert call(*show).exit_code == 0 and Path("new/skirt.png").is_file()


@pytest.mark.parametrize(
    ("draper", "message"), [("xpbd", "draper xpbd needs the simulator newton"), ("xpdb", "no draper named 'xpdb'")]
)
def test_a_draper_that_can_not_be_made_is_told(call, monkeypatch, draper, message):
    monkeypatch.setattr("mocapflow_physics.xpbd.find_spec", lambda name: None)
    shown = call("show", "garment", "skirt", "--draper", draper, "--out", "garment.png")
    assert shown.exit_code == 2
    assert f"error: show garment skirt  {message}" in shown.stderr


def test_only_a_garment_has_a_picture(call):
    assert "only a garment has a picture" in call("show", "matcher", "contour_icp", "--out", "it.png").output


@pytest.mark.long
def test_the_module_runs_as_the_command_does_and_decoders_do_not_talk_besides(tmp_path):
    shutil.copytree(CLIP, tmp_path / "clip")
    video = tmp_path / "clip" / "videos" / "cam02.mp4"
    video.write_bytes(video.read_bytes()[:20000])
    words = [sys.executable, "-m", "mocapflow", "doctor", "clip"]
    said = subprocess.run(words, check=False, cwd=tmp_path, capture_output=True)
    assert said.returncode == 2
    assert b"cam02.mp4  this video can't be decoded" in said.stdout
    assert said.stderr == b""


def test_what_stages_find_and_warn_of_is_printed_once(capsys, monkeypatch):
    ours = logging.getLogger("mocapflow")
    for logger in (ours, logging.getLogger()):
        monkeypatch.setattr(logger, "handlers", [])
    level = ours.level
    try:
        cli._tell_on_stderr()
        ours.info("first pose: 3 mm off")
        ours.warning("frame 3 is dark")
        ours.debug("not told")
        logging.getLogger("of_a_library").info("not told")
    finally:
        ours.setLevel(level)
    assert capsys.readouterr().err == "first pose: 3 mm off\nwarning: frame 3 is dark\n"
