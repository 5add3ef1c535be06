"""Commits: what is looked at before each, and what counts when one fails."""

import errno
import os

import numpy as np
import pytest

from mocapflow.errors import ComponentFailed, StoreError
from mocapflow.running.runner import run
from mocapflow.storage import checkpoint, packing
from mocapflow.storage.rows import read_json
from tests.fixtures.stores import load, run_tiny, same, the_track


def frames_saved(folder):
    return next(line for line in run_tiny(folder / "tiny.yaml", folder)[1] if "going on after" in line)


def saved_when_stopped_in(folder, monkeypatch, name, function):
    """What the next run says of the frames that a run had saved which was stopped in a function of checkpoint."""
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(checkpoint, name, function)
        run_tiny(folder / "tiny.yaml", folder)
    return frames_saved(folder)


def test_a_run_whose_track_another_has_taken_over_writes_no_more_of_it(tmp_path, path, monkeypatch):
    def report(line):
        if line.startswith("track: 3 of"):
            for lock in (tmp_path / "store.zarr" / ".state").glob("*.lock"):
                lock.write_text("another")

    monkeypatch.setattr("mocapflow.running.progress.BEAT", 0)
    with pytest.raises(StoreError, match="another run took over track-"):
        run(load(path), store=tmp_path / "store.zarr", out=tmp_path / "out", report=report)
    for lock in (tmp_path / "store.zarr" / ".state").glob("*.lock"):
        lock.unlink()
    assert frames_saved(tmp_path) == "track: going on after 3 frames"


def test_a_run_that_is_to_stop_does_so_before_the_next_commit(tmp_path, path, monkeypatch, whole):
    asked = iter([None, None])

    def check():
        if next(asked, "stop"):
            raise KeyboardInterrupt

    saved = saved_when_stopped_in(tmp_path, monkeypatch, "check", check)
    assert saved == "track: going on after 2 frames"
    assert same(the_track(whole), the_track(tmp_path))


def test_a_frame_whose_count_could_not_be_written_is_not_said_to_be_saved(tmp_path, path, monkeypatch):
    real, left = checkpoint.write_json, iter(range(3))

    def write(target, value):
        if next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(target, value)

    with monkeypatch.context() as patch, pytest.raises(StoreError, match=r"frames 0–2 are saved; .* at 3$"):
        patch.setattr(checkpoint, "write_json", write)
        run_tiny(path, tmp_path)
    assert frames_saved(tmp_path) == "track: going on after 3 frames"


def test_a_run_that_ends_after_its_last_frame_has_only_to_write_its_arrays(tmp_path, path, monkeypatch, whole):
    def seal(*_):
        raise KeyboardInterrupt

    saved = saved_when_stopped_in(tmp_path, monkeypatch, "seal", seal)
    assert saved == "track: going on after 12 frames"
    assert same(the_track(whole), the_track(tmp_path))


def test_what_was_warned_of_before_a_run_failed_is_kept_and_its_arrays_are_as_long_as_its_frames(
    tmp_path, path, monkeypatch
):
    monkeypatch.setenv("TINY_WARN_AT", "3")
    monkeypatch.setenv("TINY_RAISE_AT", "7")
    with pytest.raises(ComponentFailed):
        run_tiny(path, tmp_path)
    run_tiny(path, tmp_path, frames=5)
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    assert read_json(group / "zarr.json")["attributes"]["warnings"] == ["frame 3 is dark"]
    assert {read_json(group / name / "zarr.json")["shape"][0] for name in ("angles", "cloth")} == {7}


def test_a_frame_with_more_numbers_than_those_before_is_refused(tmp_path, path, monkeypatch):
    real = packing.values_of

    def values_of(frame, result, steps):
        return real(frame, result, steps) | ({"observed": np.zeros(3)} if frame.index == 4 else {})

    monkeypatch.setattr(packing, "values_of", values_of)
    with pytest.raises(ComponentFailed, match=r"observed of frame 4 has shape \(3,\); the frames before had \(2,\)"):
        run_tiny(path, tmp_path)


def test_a_shorter_run_that_mends_a_track_keeps_all_its_frames(tmp_path, ran, whole):
    (group,) = (tmp_path / "store.zarr").glob("track-*")
    (group / "angles" / "zarr.json").write_text("{")
    _, lines = run_tiny(ran, tmp_path, frames=5)
    assert any("is damaged and written anew from its frames" in line for line in lines)
    assert same(the_track(whole), the_track(tmp_path))
