"""The real command line while it runs: asked from elsewhere, stopped by Ctrl-C or a scheduler, and gone on with."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mocapflow.commands.progress import FILE, last_word
from mocapflow.interrupts import Interrupts, check, interrupted
from tests.fixtures.stores import run_tiny, same, the_track, write_pipeline, write_recording

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")


@pytest.fixture(autouse=True)
def heard():
    """Let children hear Ctrl-C: what runs in the background ignores it, and so would they."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def path(tmp_path):
    return write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=30))


def started(words, folder, slow="0.4"):
    environment = {**os.environ, "TINY_SLOW": slow}
    return subprocess.Popen(
        [MOCAPFLOW, *words], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def status(folder):
    done = subprocess.run([MOCAPFLOW, "status", "out"], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM], ids=["ctrl_c", "terminated"])
def test_a_run_is_asked_after_interrupted_and_gone_on_with(tmp_path, path, stop):
    words = ["run", path.name, "--out", "out", "--store", "store.zarr"]
    with started(words, tmp_path) as run:
        assert run.stderr is not None
        lines = iter(run.stderr)
        assert any(line.startswith("track: 1") for line in lines)
        said = status(tmp_path)
        run.send_signal(stop)
        rest = "".join(lines)
    assert re.search(r"^track +resume .* \d+ of 30 frames done", said, re.MULTILINE)
    assert re.search(rf"^process {run.pid} on \S+, 0:\d\d ago: track: ", said, re.MULTILINE)
    assert run.returncode == 130
    assert rest.endswith(f"interrupted; what is finished is saved. To go on: mocapflow {' '.join(words)}\n")
    assert "Traceback" not in rest
    assert not (tmp_path / "out" / FILE).exists()
    assert not list((tmp_path / "store.zarr" / ".state").glob("*.lock"))
    _, lines = run_tiny(path, tmp_path)
    assert any(re.fullmatch(r"track: going on after \d+ frames", line) for line in lines)
    whole = tmp_path / "whole"
    run_tiny(path, whole)
    assert same(the_track(tmp_path), the_track(whole))


@pytest.mark.long
def test_a_killed_run_is_known_to_have_ended(tmp_path, path):
    with started(["run", path.name, "--out", "out", "--store", "store.zarr"], tmp_path, slow="0.1") as run:
        assert run.stderr is not None
        assert any(line.startswith("track: 1") for line in run.stderr)
        run.kill()
    assert last_word(tmp_path / "out").endswith("ended without finishing; run the same command to go on")


def test_no_run_no_last_word(tmp_path):
    assert last_word(tmp_path) == ""
    (tmp_path / FILE).write_text("{")
    assert last_word(tmp_path) == ""


@pytest.fixture
def listening(heard):
    before = signal.getsignal(signal.SIGTERM)
    Interrupts().install()
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM], ids=["ctrl_c", "terminated"])
def test_an_interrupt_that_compiled_code_swallowed_is_heard_at_the_next_frame(listening, stop):
    check()
    assert not interrupted(RuntimeError())
    with contextlib.suppress(KeyboardInterrupt):  # as a callback of a library does
        os.kill(os.getpid(), stop)
        time.sleep(1)
    with pytest.raises(KeyboardInterrupt):
        check()
    assert interrupted(RuntimeError("no compiled object yet"))


def test_what_ignores_ctrl_c_goes_on_to(listening):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Interrupts().install()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
