"""Runs and plans: what is taken from the store, what goes on, what is made, and why."""

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import wraps
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from mocapflow.config.pipeline import load_pipeline
from mocapflow.errors import (
    ComponentFailed,
    GarmentError,
    MocapflowError,
    PipelineError,
    PluginError,
    RecordingError,
    StoreError,
)
from mocapflow.hookspecs import hookimpl
from mocapflow.running.runner import plan, run
from mocapflow.storage.store import Store
from tests.fixtures.stores import STAGES, actions, load, run_tiny, same, the_track, write_pipeline, write_recording

ROOT = Path(__file__).parents[2]


def outlook(path, folder, *changes, frames=None):
    lines = plan(load(path, *changes, frames=frames), store=folder / "store.zarr")
    return {line.label: (line.action, line.why) for line in lines}


@pytest.mark.parametrize("out", ["clip", "clip/videos", "elsewhere/../clip/background/run", "clip/static/run"])
def test_a_run_folder_among_the_files_of_its_recording_is_refused(tmp_path, path, out):
    (tmp_path / "elsewhere").mkdir()
    before = sorted((tmp_path / "clip").rglob("*"))
    with pytest.raises(PipelineError, match="among the files of the recording"):
        run(load(path), store=tmp_path / "store.zarr", out=tmp_path / out)
    with pytest.raises(PipelineError, match="the stored results would lie among the files of the recording"):
        run(load(path), store=tmp_path / out, out=tmp_path / "out")
    assert sorted((tmp_path / "clip").rglob("*")) == before
    run(load(path, frames=2), store=tmp_path / "store.zarr", out=tmp_path / "clip" / "runs" / "mine")


def test_a_plan_says_what_a_run_does(tmp_path, path):
    always = ("run", "writes files or compares: always")
    new = ("run", "new")
    assert outlook(path, tmp_path) == {
        "background": new, "start": new, "track": new, "smooth": new, "export": always,
    }  # fmt: skip
    assert not (tmp_path / "store.zarr").exists()  # a plan writes nothing
    run_tiny(path, tmp_path, frames=5)
    assert outlook(path, tmp_path, frames=5)["track"] == ("hit", "5 frames")
    assert outlook(path, tmp_path) == {
        "background": ("hit", ""),
        "start": ("hit", ""),
        "track": ("resume", "5 of 12 frames done"),
        "smooth": ("run", "new: track grew from 5 to 12 frames"),
        "export": always,
    }
    assert outlook(path, tmp_path, frames=3)["track"] == ("hit", "3 frames")
    changed = outlook(path, tmp_path, "stages.track.draper=other_draper", frames=5)
    assert changed["track"] == ("run", "new: draper tiny_draper → other_draper")
    assert changed["smooth"] == ("run", "new: track was made anew")


def test_a_plan_says_what_is_left_of_a_run_that_failed(tmp_path, path, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "7")
    with pytest.raises(ComponentFailed):
        run_tiny(path, tmp_path)
    assert outlook(path, tmp_path)["track"] == ("resume", "7 of 12 frames done")
    assert outlook(path, tmp_path, frames=5)["track"] == ("resume", "5 of 5 frames done")


def test_a_plan_line_for_people(tmp_path, path):
    lines = [str(line) for line in plan(load(path), store=tmp_path / "store.zarr")]
    assert [line.split()[:2] for line in lines[:2]] == [["background", "run"], ["start", "run"]]
    assert lines[4].endswith("(track ← smooth)")


def test_a_plan_explains_edited_files(tmp_path, ran):
    (tmp_path / "clip" / "subject.txt").write_text("another")
    assert outlook(ran, tmp_path)["start"] == ("run", "new: subject.txt changed")
    assert outlook(ran, tmp_path)["background"] == ("hit", "")


def test_variants_share_what_comes_before(tmp_path, path):
    first, _ = run_tiny(path, tmp_path)
    assert set(actions(first).values()) == {"run"}
    second, lines = run_tiny(path, tmp_path, "stages.track.draper=other_draper")
    assert actions(second) == {"background": "hit", "start": "hit", "track": "run", "smooth": "run", "export": "run"}
    assert "background: from the store" in lines
    third, _ = run_tiny(path, tmp_path)
    assert actions(third) == {"background": "hit", "start": "hit", "track": "hit", "smooth": "hit", "export": "run"}


def test_fresh_makes_everything_anew(tmp_path, ran):
    again, lines = run_tiny(ran, tmp_path, fresh=True)
    assert set(actions(again).values()) == {"run"}
    assert sum(": running " in line for line in lines) == len(STAGES)  # each once, whoever needs it
    assert len([p for p in (tmp_path / "store.zarr").iterdir() if p.name.startswith("track")]) == 1


def blas_threads():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_run_computes_in_one_thread_and_leaves_the_others_to_the_caller(tmp_path, path):
    during = set()
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        run(
            load(path), store=tmp_path / "s", out=tmp_path / "run", report=lambda line: during.update(blas_threads())
        )  # fmt: skip
        assert blas_threads() == before
    assert during == {1}


def test_later_stages_know_how_the_earlier_ones_were_made(tmp_path, ran):
    run_tiny(ran, tmp_path)
    recipe = json.loads((tmp_path / "out" / "results.json").read_text())["recipe"]
    assert list(recipe["stages"]) == ["background", "start", "track", "smooth"]
    assert recipe["stages"]["track"]["cached"] is True
    assert set(recipe["stages"]["track"]) == {"label", "key", "cached", "seconds", "wall_seconds", "warnings"}
    assert recipe["versions"]["numpy"] == np.__version__
    assert recipe["settings"]["track"]["settings"]["segmenter"]["settings"]["sigma_px"] == 2.0


@pytest.mark.long
def test_what_a_stage_warned_of_is_told_again_when_it_comes_from_the_store(tmp_path, path, caplog):
    far, said = "stages.start={use: tiny_start, angle_rad: 1.5}", "the first pose bends far"
    run_tiny(path, tmp_path, far)
    assert caplog.messages == [said]
    for _ in range(2):
        recipe = json.loads((tmp_path / "out" / "results.json").read_text())["recipe"]
        assert {label: entry["warnings"] for label, entry in recipe["stages"].items() if entry["warnings"]} == {
            "start": [said]
        }
        _, lines = run_tiny(path, tmp_path, far)
        assert f"warning: {said}" in lines


def test_what_a_track_warned_of_is_kept_with_its_frames(tmp_path, path, monkeypatch):
    def warned():
        recipe = json.loads((tmp_path / "out" / "results.json").read_text())["recipe"]
        return recipe["stages"]["track"]["warnings"]

    monkeypatch.setenv("TINY_WARN_AT", "3")
    run_tiny(path, tmp_path, frames=5)
    monkeypatch.setenv("TINY_WARN_AT", "7")
    run_tiny(path, tmp_path, frames=9)
    both = ["frame 3 is dark", "frame 7 is dark"]  # each in several turns
    assert warned() == both
    monkeypatch.delenv("TINY_WARN_AT")
    _, lines = run_tiny(path, tmp_path, frames=9)
    assert warned() == both and f"warning: {both[0]}" in lines


def test_what_is_odd_about_a_recording_is_told_when_it_is_run(tmp_path, path):
    _, lines = run_tiny(path, tmp_path, frames=2)
    said = "\n".join(lines)
    assert said.count("warning: nothing says the frame rate: 30 frames per second assumed") == 1
    assert "warning: the images' up is the y axis of the world" in said


def test_a_body_made_by_a_stage_replaces_the_body_of_later_ones(tmp_path):
    body = {"use": "tiny_body", "size_m": 1.5}
    stages = {"start": "tiny_start", "grow": "tiny_grow", "track": STAGES["track"], "export": "tiny_export"}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages, body=body)
    run_tiny(path, tmp_path)
    assert json.loads((tmp_path / "out" / "results.json").read_text())["body"] == pytest.approx(3.0)
    summary, _ = run_tiny(path, tmp_path)
    assert actions(summary)["grow"] == "hit"
    assert json.loads((tmp_path / "out" / "results.json").read_text())["body"] == pytest.approx(3.0)


def test_cameras_made_by_a_stage_replace_those_of_later_ones(tmp_path):
    stages = {"start": "tiny_start", "align": "tiny_align", "track": STAGES["track"], "export": "tiny_export"}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages)
    for action in ("run", "hit"):
        assert actions(run_tiny(path, tmp_path)[0])["align"] == action
        cameras = json.loads((tmp_path / "out" / "results.json").read_text())["cameras"]
        assert cameras and all(name.startswith("aligned ") for name in cameras)


def test_of_a_recording_that_a_stage_changes_each_stage_gets_its_frames(tmp_path):
    """The start takes the first frame only, and says so."""
    stages = {"corrupt": "corrupt", "start": "tiny_start", "track": STAGES["track"]}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages)
    run_tiny(path, tmp_path, frames=3)
    assert len(the_track(tmp_path).frame) == 3


def test_a_run_that_is_to_stop_begins_no_other_stage(tmp_path, path, monkeypatch):
    """Also where compiled code of the stage before has swallowed the signal."""
    asked = iter([None])

    def check():
        if next(asked, "stop"):
            raise KeyboardInterrupt

    monkeypatch.setattr("mocapflow.running.execution.check", check)
    with pytest.raises(KeyboardInterrupt):
        run_tiny(path, tmp_path)
    assert [found.path.name.partition("-")[0] for found in Store(tmp_path / "store.zarr").artifacts()] == ["background"]


def test_what_a_single_stage_needs_is_told_with_it(tmp_path, ran):
    summary = run(load(ran), store=tmp_path / "store.zarr", out=tmp_path / "out", only="export")
    assert actions(summary) == {"smooth": "hit", "export": "run"}


def test_evaluations_always_run_and_are_not_stored(tmp_path):
    stages = {k: STAGES[k] for k in ("start", "track")} | {"evaluate": "tiny_evaluate"}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=3), stages=stages)
    for _ in range(2):
        assert actions(run_tiny(path, tmp_path)[0])["evaluate"] == "run"
    assert not list((tmp_path / "store.zarr").glob("evaluate-*"))


def test_observers_are_told(tmp_path, path):
    told = []

    class Onlooker:
        @hookimpl
        def mocapflow_iteration_done(self, frame, iteration):
            told.append(("turn", frame, iteration))

        @hookimpl
        def mocapflow_frame_done(self, frame, result):
            told.append(("frame", frame))

        @hookimpl
        def mocapflow_stage_done(self, stage, cached):
            told.append(("stage", stage, cached))

    pipeline = load(path, frames=2)
    pipeline.registry._manager.register(Onlooker())
    run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    assert told[:2] == [("stage", "background", False), ("stage", "start", False)]
    assert [t for t in told if t[0] == "frame"] == [("frame", 0), ("frame", 1)]
    assert told.index(("turn", 0, 1)) < told.index(("frame", 0)) < told.index(("turn", 1, 0))
    assert told[-1] == ("stage", "export", False)


def test_a_body_that_raises_is_named(tmp_path, path, monkeypatch):
    pipeline = load(path)

    def load_body(self, recording):
        raise ValueError("no such joint\nmore")

    monkeypatch.setattr(type(pipeline.body), "load", load_body)
    with pytest.raises(
        ComponentFailed, match=r"^body 'tiny_body' \(plugin 'tiny_plugin' .*\) failed: ValueError: no such joint"
    ):
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")


def test_a_result_that_can_not_be_kept_names_its_stage(tmp_path, path, monkeypatch):
    def save(self, artifact, value, warnings):
        raise TypeError("Object of type set is not JSON serializable")

    monkeypatch.setattr(Store, "save", save)
    with pytest.raises(ComponentFailed, match=r"^stage 'tiny_background' .* failed: TypeError: Object of type set"):
        run_tiny(path, tmp_path)


def test_a_result_that_can_not_be_kept_is_not_told_as_done(tmp_path, path, monkeypatch):
    def save(self, artifact, value, warnings):
        raise OSError(errno.ENOSPC, "No space left on device")

    class Onlooker:
        @hookimpl
        def mocapflow_stage_done(self, stage):
            told.append(stage)

    told, pipeline = [], load(path)
    pipeline.registry._manager.register(Onlooker())
    monkeypatch.setattr(Store, "save", save)
    with pytest.raises(StoreError, match="No space left"):
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    assert told == []


def test_a_result_that_is_no_number_is_not_kept(tmp_path, path, monkeypatch):
    pipeline = load(path)
    stage = type(pipeline.stages[1].stage)

    @wraps(stage.run)
    def lost(self, *given, **named):
        made = real(self, *given, **named)
        return replace(made, pose=replace(made.pose, angles=np.full(2, np.nan)))

    real = stage.run
    monkeypatch.setattr(stage, "run", lost)
    with pytest.raises(ComponentFailed, match=r"^stage 'tiny_start' .* failed: it returned a pose that is not finite"):
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    assert [found.path.name.partition("-")[0] for found in Store(tmp_path / "store.zarr").artifacts()] == ["background"]


@pytest.mark.parametrize("inputs", ["subject.txt", ["subject.txt"], None, iter([Path("subject.txt")])])
def test_inputs_that_are_no_paths_name_the_body(tmp_path, path, monkeypatch, inputs):
    pipeline = load(path)
    monkeypatch.setattr(type(pipeline.body), "inputs", lambda self, folder: inputs)
    with pytest.raises(PluginError, match=r"'tiny_body' returned the inputs .*, which are no list of Path"):
        plan(pipeline, store=tmp_path / "store.zarr")


def test_a_stage_of_an_extent_that_is_none(tmp_path, path, monkeypatch):
    pipeline = load(path)
    monkeypatch.setattr(type(pipeline.stages[1].stage), "extent", "al")
    with pytest.raises(PluginError, match="tiny_start has the extent 'al'\n +available: all, beginning"):
        plan(pipeline, store=tmp_path / "store.zarr")


def test_measures_that_can_not_be_sewn_are_told_where_they_are_written(tmp_path, path, monkeypatch):
    pipeline, store = load(path), tmp_path / "store.zarr"

    def sew(self, body):
        raise GarmentError("too short", hint="lengthen it")

    monkeypatch.setattr(type(pipeline.garment), "sew", sew)
    said = r"^.*\.yaml:\d+:\d+  too short\n       lengthen it$"
    with pytest.raises(GarmentError, match=said):
        plan(pipeline, store=store)
    with pytest.raises(GarmentError, match=said):
        run(pipeline, store=store, out=tmp_path / "out")
    assert not store.exists() and not (tmp_path / "out").exists()  # told before anything is made


@pytest.mark.parametrize(
    ("hint", "where"),
    [("lengthen length_m", "--set garment.length_m=0.1"), ("", ".*.yaml:.*"), ("shorten arm_length_m", ".*.yaml:.*")],
)
def test_a_measure_of_the_command_line_is_told_as_such(tmp_path, path, monkeypatch, hint, where):
    pipeline = load_pipeline(path, changes=["garment.length_m=0.1"])

    def sew(self, body):
        raise GarmentError("can't be worn", hint=hint)

    monkeypatch.setattr(type(pipeline.garment), "sew", sew)
    with pytest.raises(GarmentError, match=rf"^{where}  can't be worn"):
        plan(pipeline, store=tmp_path / "store.zarr")


def test_a_garment_that_raises_is_told_by_a_plan(tmp_path, path, monkeypatch):
    pipeline, store = load(path), tmp_path / "store.zarr"

    def sew(self, body):
        raise ValueError("torn")

    monkeypatch.setattr(type(pipeline.garment), "sew", sew)
    with pytest.raises(ComponentFailed, match=r"^garment 'tiny_garment' \(.*\) failed: ValueError: torn$"):
        plan(pipeline, store=store)
    with pytest.raises(ComponentFailed, match=r"failed: ValueError: torn\n       traceback: .*out.failed\.log$"):
        run(pipeline, store=store, out=tmp_path / "out")


def test_a_garment_that_only_the_fitted_body_can_wear(tmp_path, monkeypatch):
    stages = {"fit": "tiny_fit", "start": "tiny_start", "track": STAGES["track"], "export": "tiny_export"}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=2), stages=stages)
    pipeline = load(path)
    garment = type(pipeline.garment)
    sewn = garment.sew

    def sew(self, body):
        if np.ptp(body.vertices[:, 2]) < 1.5:
            raise GarmentError("too small for that", hint="who wears it?")
        return sewn(self, body)

    monkeypatch.setattr(garment, "sew", sew)
    assert {line.action for line in plan(pipeline, store=tmp_path / "store.zarr")} == {"run"}
    with monkeypatch.context() as lacking:
        lacking.setattr(type(pipeline.body), "load", None)  # the body is looked at all the same
        with pytest.raises(ComponentFailed, match="body 'tiny_body'"):
            plan(pipeline, store=tmp_path / "store.zarr")
    run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    assert json.loads((tmp_path / "out/results.json").read_text())["body"] == 2.0
    monkeypatch.setattr(garment, "sew", lambda self, body: sew(self, replace(body, vertices=body.vertices / 2)))
    with pytest.raises(GarmentError, match=r"\.yaml:\d+:\d+  too small for that"):
        run(pipeline, store=tmp_path / "other.zarr", out=tmp_path / "out")


def test_a_garment_is_not_sewn_for_what_is_in_the_store(tmp_path, monkeypatch):
    stages = {name: STAGES[name] for name in ("start", "track")}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=2), stages=stages)
    run_tiny(path, tmp_path)
    pipeline = load(path)
    monkeypatch.setattr(type(pipeline.garment), "sew", None)
    assert {line.action for line in plan(pipeline, store=tmp_path / "store.zarr")} == {"hit"}


def test_what_a_body_lacks_is_told_by_a_plan(tmp_path, path, monkeypatch):
    def need(self, recording):
        raise RecordingError("there is no scan")

    pipeline = load(path)
    monkeypatch.setattr(type(pipeline.body), "need", need)
    with pytest.raises(RecordingError, match="there is no scan"):
        plan(pipeline, store=tmp_path / "store.zarr")


def test_a_fresh_run_that_can_not_begin_leaves_the_store_as_it_is(tmp_path, monkeypatch):
    def sew(self, body):
        raise GarmentError("too short", hint="lengthen it")

    stages = {name: STAGES[name] for name in ("start", "track")}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=2), stages=stages)
    run_tiny(path, tmp_path)
    pipeline, store = load(path), Store(tmp_path / "store.zarr")
    before = store.artifacts()
    monkeypatch.setattr(type(pipeline.garment), "sew", sew)
    with pytest.raises(GarmentError, match="too short"):
        run(pipeline, store=store.path, out=tmp_path / "out", fresh=True)
    assert store.artifacts() == before


def test_a_run_folder_that_cannot_be_made(tmp_path, path):
    (tmp_path / "out").write_text("")
    with pytest.raises(MocapflowError, match="can't write the run folder") as caught:
        run_tiny(path, tmp_path)
    assert caught.value.exit_status == 2  # a wrong name


def test_folders_may_be_named_by_text(tmp_path, path):
    pipeline = load_pipeline(str(path), recording=str(load_pipeline(path).recording), folder=str(tmp_path))
    assert run(pipeline, store=str(tmp_path / "store.zarr"), out=str(tmp_path / "out")).out == tmp_path / "out"
    assert "hit" in {line.action for line in plan(pipeline, store=str(tmp_path / "store.zarr"))}


def test_results_do_not_depend_on_truth_and_reference(tmp_path, ran):
    for name in ("truth", "reference"):
        (tmp_path / "clip" / name).mkdir()
        (tmp_path / "clip" / name / "angles.csv").write_text("frame\n")
    summary, _ = run_tiny(ran, tmp_path)
    assert actions(summary)["track"] == "hit"


@pytest.mark.parametrize("at", ["start", "track"])
@pytest.mark.long
def test_a_file_that_changes_while_a_run_goes_on_ends_it(tmp_path, monkeypatch, at):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", video=True))
    file = tmp_path / "clip" / "videos" / "cam01.mp4"
    run_tiny(path, tmp_path / "before")
    was = file.read_bytes()

    def report(line):
        if line == "start: running tiny_start":
            os.utime(file)  # the same content: no matter
        if line.startswith({"start": "start: running", "track": "track: 1 of"}[at]):
            file.write_bytes(was + b"more")

    monkeypatch.setattr("mocapflow.running.progress.BEAT", 0)
    with pytest.raises(RecordingError, match="cam01.mp4  this has changed since the run began"):
        run(load(path), store=tmp_path / "store.zarr", out=tmp_path / "out", report=report)
    file.write_bytes(was)
    summary, lines = run_tiny(path, tmp_path)
    assert ("track: going on after 1 frames" in lines) == (at == "track")
    assert actions(summary)["start"] == ("hit" if at == "track" else "run")
    assert same(the_track(tmp_path), the_track(tmp_path / "before"))


@pytest.mark.long
def test_two_processes_on_one_store(tmp_path, path, monkeypatch):
    monkeypatch.setenv("TINY_SLOW", "0.02")
    command = [sys.executable, str(ROOT / "tests" / "fixtures" / "stores.py"), str(path), str(tmp_path)]
    running = [subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [process.communicate()[0] for process in running]
    assert [process.returncode for process in running] == [0, 0]
    assert sorted("track: running coupled_loop" in lines for lines in said) == [False, True]


def test_a_first_segmenter_that_is_not_asked_is_told(tmp_path, path):
    changes = ("stages.background=null", "stages.track.first_segmenter=background")
    run_tiny(path, tmp_path, *changes, frames=2)
    recipe = json.loads((tmp_path / "out" / "results.json").read_text())["recipe"]
    (said,) = recipe["stages"]["track"]["warnings"]
    assert said.startswith("first_segmenter background needs the empty scene")
