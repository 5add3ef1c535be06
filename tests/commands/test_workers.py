"""A grid on the workers of a real dask scheduler: what they share is made once, and one of them may die."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from functools import partial

import pytest

from mocapflow.commands.comparing import run_cell
from mocapflow.commands.invocation import Invocation
from mocapflow.commands.workers import finished
from mocapflow.errors import PipelineError
from mocapflow.storage.store import Store
from tests.fixtures.stores import same, write_pipeline, write_recording

dask = pytest.importorskip("dask")
pytest.importorskip("distributed")
DRAPERS, GAINS, CLIPS = ("tiny_draper", "other_draper"), (0.9, 0.5), ("one", "two")
DASK = (sys.executable, "-m", "dask")


def results(tasks, workers, scheduler):
    """What all tasks return, by key."""
    return {key: result() for key, result in finished(tasks, workers, scheduler)}


def grid(folder, store):
    """Two drapers by two pose solvers by two recordings, as tasks by run folder."""
    tasks = {}
    for clip in CLIPS:
        pipeline = write_pipeline(folder, folder / clip)
        for draper in DRAPERS:
            for gain in GAINS:
                changes = (
                    f"stages.track.draper={draper}",
                    f"stages.track.pose_solver={{use: tiny_solver, gain: {gain}}}",
                )
                cell = Invocation(str(pipeline), str(folder / clip), changes, None, str(folder / store))
                out = folder / store / "runs" / f"{draper}-{gain}" / clip
                tasks[out] = partial(run_cell, cell, out)
    return tasks


@contextmanager
def cluster(folder, workers=2, slow="0"):
    """A scheduler and workers as somebody would start them in a shell; gives its address and the workers."""
    environment = {**os.environ, "TINY_SLOW": slow}
    start = partial(subprocess.Popen, env=environment, cwd=folder, stdout=subprocess.DEVNULL, text=True)
    address = folder / "scheduler.json"
    words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(address)]
    running = [start([*DASK, "scheduler", *words], stderr=subprocess.DEVNULL)]
    try:
        for number in range(workers):
            words = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", str(address)]
            with (folder / f"worker{number}.log").open("w") as log:
                running.append(start([*DASK, "worker", *words, "--local-directory", str(folder)], stderr=log))
        while not address.exists() or not address.read_text():
            assert running[0].poll() is None
        yield json.loads(address.read_text())["address"], running[1:]
    finally:
        for process in running:
            process.kill()  # asked to end, a worker that has lost its scheduler may wait for ever
        for process in running:
            process.wait()


def tracks(store):
    kept = Store(store)
    return {a.key: kept.load(a) for a in kept.artifacts() if a.path.name.startswith("track-") and a.complete}


@pytest.fixture
def clips(tmp_path):
    for count, clip in enumerate(CLIPS, 10):
        write_recording(tmp_path / clip, frames=count)
    results(grid(tmp_path, "alone"), 1, None)
    return tmp_path


def equal(folder):
    """Both stores hold the same eight tracks, bit by bit."""
    alone, cluster = tracks(folder / "alone"), tracks(folder / "shared")
    return len(alone) == 8 and alone.keys() == cluster.keys() and all(same(alone[key], cluster[key]) for key in alone)


@pytest.mark.long
def test_a_grid_on_a_scheduler_shares_what_its_variants_share(clips):
    with cluster(clips) as (address, _):
        said = results(grid(clips, "shared"), 1, address)
    for stage, times in {"background": 2, "start": 2, "track": 8}.items():
        assert sum(stage in line for line in said.values()) == times, said
    assert equal(clips)


def frames_of(worker, store):
    """How many frames the track has that a worker is making."""
    for lock in (store / ".state").glob("*.lock"):
        with suppress(OSError, ValueError):  # it has just finished
            if json.loads(lock.read_text())["pid"] == worker.pid:
                return max((a.frames for a in Store(store).artifacts() if a.key.startswith(lock.stem)), default=0)
    return 0


def kill_while_it_tracks(worker, store):
    deadline = time.monotonic() + 60
    while not 2 <= frames_of(worker, store) <= 7 and time.monotonic() < deadline:
        time.sleep(0.02)
    worker.kill()


@pytest.mark.long
def test_a_lost_worker_costs_only_the_frame_in_flight(clips):
    with cluster(clips, slow="0.2") as (address, workers):
        killer = threading.Thread(target=kill_while_it_tracks, args=(workers[0], clips / "shared"))
        killer.start()
        assert len(results(grid(clips, "shared"), 1, address)) == 8
        killer.join()
        assert workers[0].poll() == -signal.SIGKILL
    log = (clips / "worker1.log").read_text()
    assert re.search(r"taking over from process \d+ on \S+, which ended without finishing", log)
    assert re.search(r"track: going on after [2-9] frames", log)
    assert equal(clips)


def test_no_scheduler():
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(PipelineError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:1\n.*`dask scheduler`"),
    ):
        results({"task": str}, 1, "tcp://127.0.0.1:1")
