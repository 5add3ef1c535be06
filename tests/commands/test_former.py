"""No result passes for one of another run: results in a run folder belong to the run that it remembers."""

import errno
import fcntl
import re
import shutil
import threading
from pathlib import Path

import pytest
import yaml
from mocapflow_export import layout
from typer.testing import CliRunner

from mocapflow import cli
from mocapflow.commands import invocation
from mocapflow.commands.former import FORMER, differing, set_aside
from mocapflow.commands.invocation import FILE, alone
from mocapflow.errors import StoreError
from tests.fixtures.stores import PLUGIN, STAGES, write_pipeline, write_recording

OUT = Path("out")


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Calls the command line beside a pipeline that writes angles.csv and run.json of three frames."""
    monkeypatch.chdir(tmp_path)
    write_pipeline(tmp_path, write_recording(tmp_path / "clip", 3), stages={**STAGES, "export": "export"})

    def invoke(*words):
        return CliRunner().invoke(cli.app, words, prog_name="mocapflow")

    return invoke


def run(call, *changes):
    done = call("run", "tiny.yaml", "--out", "out", *changes)
    assert done.exit_code == 0, done.output
    return done


def test_a_damaged_memory_of_the_run_is_told(call):
    run(call)
    (OUT / FILE).write_text("[]")
    told = call("status", "out")
    assert told.exit_code == 2 and "command.json  this file is damaged" in told.stderr


@pytest.mark.long
def test_results_of_another_run_are_set_aside(call):
    run(call)
    (OUT / layout.ERRORS).write_text("of the first run")
    assert "the run before" not in run(call).stderr
    assert (OUT / layout.ERRORS).exists()
    other = run(call, "--frames", "0:2")
    assert "the results of the run before are now in out/former/1" in other.stderr
    assert not (OUT / layout.ERRORS).exists()
    assert len((OUT / layout.ANGLES).read_text().splitlines()) == 3
    assert len((OUT / FORMER / "1" / layout.ANGLES).read_text().splitlines()) == 4


def test_what_is_no_run_s_is_set_aside_too(call):
    (OUT / layout.ANGLES).parent.mkdir(parents=True)
    (OUT / layout.ANGLES).write_text("mine")
    assert "what lay there under the names of results is now in out/former/1" in run(call).stderr
    assert (OUT / FORMER / "1" / layout.ANGLES).read_text() == "mine"


def test_a_store_among_the_results_is_refused(call):
    for store in (OUT / "results", OUT / FORMER / "store"):
        done = call("run", "tiny.yaml", "--out", "out", "--store", str(store))
        assert done.exit_code == 2 and "the store would lie among the files of the run" in done.stderr
    run(call, "--store", "out/store.zarr")


def test_a_run_that_fails_leaves_no_results_of_another(call):
    run(call)
    failed = call("run", "tiny.yaml", "--out", "out", "--set", "stages.evaluate={use: evaluate, reference: videos}")
    assert failed.exit_code == 2 and "keypoints" in failed.stderr
    assert (OUT / layout.RUN).exists() and (OUT / FORMER / "1" / layout.RUN).exists()


def test_what_a_failed_run_has_left_is_no_result_of_the_next(call):
    (OUT / layout.RESULTS).mkdir(parents=True)
    (OUT / layout.ERRORS).write_text("of a run that failed before it wrote run.json")
    (OUT / FILE).write_text("{}")
    run(call)
    assert not (OUT / layout.ERRORS).exists() and (OUT / FORMER / "1" / layout.ERRORS).exists()


def test_a_folder_that_nothing_was_run_in_is_left_as_it_is(call):
    (OUT / layout.RESULTS).mkdir(parents=True)
    (OUT / layout.RESULTS / "mine.txt").write_text("notes")
    run(call)
    assert (OUT / layout.RESULTS / "mine.txt").exists() and not (OUT / FORMER).exists()


def test_only_what_is_there_is_moved_and_every_run_is_kept(tmp_path):
    assert set_aside(tmp_path) is None and not list(tmp_path.iterdir())
    for said in ("one", "two"):
        (tmp_path / layout.RUN).write_text(said)
        (tmp_path / "mine.txt").write_text("notes")
        assert (set_aside(tmp_path) / layout.RUN).read_text() == said
    assert sorted(path.name for path in (tmp_path / FORMER).iterdir()) == ["1", "2"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [FORMER, "mine.txt"]


def test_what_differs_is_named():
    assert differing({"track": "a", "smooth": "b"}, {"track": "a", "smooth": "b"}) == []
    assert differing({"track": "a", "smooth": "b"}, {"track": "c", "smooth": "b"}) == ["track"]
    assert differing({"track": "a", "smooth": "b"}, {"track": "a", "export": "d"}) == ["smooth", "export"]


def test_a_recording_that_was_moved_is_named(call):
    run(call)
    Path("clip").rename("moved")
    lost = call("status", "out")
    assert lost.exit_code == 2 and lost.stderr.endswith("--recording DIR names another\n")
    assert re.search(r"^track +hit ", call("status", "out", "--recording", "moved").stdout, re.MULTILINE)
    exported = call("export", "out", "--format", "trc", "--recording", "moved")
    assert exported.exit_code == 0 and (OUT / layout.JOINTS).exists(), exported.output
    evaluated = call("evaluate", "out", "--recording", "moved")
    assert "there is nothing to compare with\n       the recording has no truth" in evaluated.stderr


@pytest.mark.long
def test_an_export_is_of_the_track_that_was_exported(call):
    run(call, "--set", "stages.export={use: export, from: {track: track}, formats: [csv]}")
    files = (OUT / layout.ANGLES).read_text(), (OUT / layout.RUN).read_text()
    exported = call("export", "out", "--format", "csv", "--format", "trc")
    assert exported.exit_code == 0 and "export: running write_formats" in exported.stderr
    assert ((OUT / layout.ANGLES).read_text(), (OUT / layout.RUN).read_text()) == files
    assert (OUT / layout.JOINTS).exists()
    again = run(call, "--set", "stages.export={use: export, from: {track: track}, formats: [csv]}")
    assert "the run before" not in again.stderr


@pytest.mark.parametrize(
    ("edit", "changed"),
    [
        ({"track": {**STAGES["track"], "steady": {"max_turns": 3}}}, "track"),
        ({"smooth": None}, "export, smooth"),
        ({"export": {"use": "export", "from": {"track": "track"}}}, "export"),
    ],
    ids=["a setting", "a stage removed", "another track exported"],
)
@pytest.mark.long
def test_an_export_after_an_edit_is_refused(call, edit, changed):
    run(call)
    content = yaml.safe_load(Path("tiny.yaml").read_text())
    stages = {label: stage for label, stage in (content["stages"] | edit).items() if stage}
    Path("tiny.yaml").write_text(yaml.safe_dump(content | {"stages": stages}, sort_keys=False))
    refused = call("export", "out", "--format", "trc")
    assert refused.exit_code == 2
    what = "pipeline, recording or mocapflow have changed since this run"
    said, _, labels = refused.stderr.splitlines()[0].rpartition(": ")
    assert said == f"error: out  {what}" and set(labels.split(", ")) == set(changed.split(", "))


@pytest.fixture
def updated(call, tmp_path):
    """Calls the command line beside a finished run whose plugin has other code now."""
    plugin, content = tmp_path / "mine.py", yaml.safe_load(Path("tiny.yaml").read_text())
    plugin.write_text(PLUGIN.read_text())
    Path("tiny.yaml").write_text(yaml.safe_dump(content | {"plugins": ["mine.py"]}, sort_keys=False))
    run(call, "--set", "stages.export={use: export, formats: [csv]}")
    plugin.write_text(plugin.read_text().replace("0.1 * np.sin", "0.2 * np.sin"))
    return call


def test_an_export_after_a_change_of_code_is_of_the_track_that_was_made(updated):
    angles = (OUT / layout.ANGLES).read_text()
    exported = updated("export", "out", "--format", "csv", "--format", "trc")
    assert exported.exit_code == 0, exported.output
    assert "warning: code has changed since this run; what it has made by mocapflow 0.1.0 on " in exported.stderr
    assert "track: from the store" in exported.stderr and "running tiny_" not in exported.stderr
    assert (OUT / layout.ANGLES).read_text() == angles and (OUT / layout.JOINTS).exists()


def test_an_export_makes_nothing_anew_by_other_code(updated):
    for group in Path("store.zarr").glob("track-*"):
        shutil.rmtree(group)
    refused = updated("export", "out", "--format", "csv")
    assert refused.exit_code == 2
    assert "code has changed since this run, and its track is not in the store" in refused.stderr


def test_an_export_after_a_change_of_code_and_of_the_recording_is_refused(updated):
    (Path("clip") / "subject.txt").write_text("another")
    refused = updated("export", "out", "--format", "csv")
    assert refused.exit_code == 2 and "have changed since this run: " in refused.stderr


def test_one_run_at_a_time_writes_into_a_folder(tmp_path, capsys):
    entered = threading.Event()

    def other():
        with alone(tmp_path):
            entered.set()

    waiting = threading.Thread(target=other)
    with alone(tmp_path):
        waiting.start()
        assert not entered.wait(0.2)
    waiting.join(10)
    assert entered.is_set()
    assert "waiting for another run that writes into it" in capsys.readouterr().err


def test_a_run_folder_that_can_not_be_locked_is_told(tmp_path, monkeypatch):
    def unknown(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", unknown)
    with pytest.raises(StoreError, match="can't write the run folder: No locks available"), alone(tmp_path):
        pass


def test_a_run_folder_on_a_full_drive_is_told(call, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(invocation, "atomic_write", full)
    told = call("run", "tiny.yaml", "--out", "out")
    assert told.exit_code == 1
    what = "can't write the run folder: No space left on device\n       name another folder, or free some space"
    assert told.stderr == f"error: out  {what}\n"


def test_a_run_leaves_no_traceback_of_one_that_failed_before(call, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "1")
    assert call("run", "tiny.yaml", "--out", "out").exit_code == 1
    assert (OUT / "failed.log").exists()
    monkeypatch.delenv("TINY_RAISE_AT")
    run(call)
    assert not (OUT / "failed.log").exists()


def test_a_stage_is_not_blamed_for_a_full_drive(call):
    OUT.mkdir()
    (OUT / "results.json").symlink_to("/dev/full")
    told = call("run", "tiny.yaml", "--out", "out", "--set", "stages.export=tiny_export")
    assert told.exit_code == 1
    assert "can't be written or read: No space left on device" in told.stderr and "plugin" not in told.stderr
