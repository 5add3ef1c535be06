"""A trace that is asked for after frames were tracked: people hear which frames have none."""

from mocapflow.running.runner import plan
from tests.fixtures.stores import actions, load, run_tiny

TRACE = "stages.track.keep=trace"
SAID = "warning: track: frames {} have no trace, for they were tracked without keep: trace; --fresh tracks all anew"


def warned(lines):
    return [line for line in lines if "trace" in line]


def outlook(path, folder, *changes):
    return next(line.why for line in plan(load(path, *changes), store=folder / "store.zarr") if line.label == "track")


def test_a_track_of_the_store_without_a_trace_says_so(tmp_path, path):
    run_tiny(path, tmp_path)
    assert outlook(path, tmp_path) == "12 frames"
    assert outlook(path, tmp_path, TRACE) == "12 frames; 0–11 without a trace: --fresh"
    summary, lines = run_tiny(path, tmp_path, TRACE)
    assert actions(summary)["track"] == "hit"
    assert warned(lines) == [SAID.format("0–11")]
    assert warned(summary.stages[2]["warnings"]) == [SAID.format("0–11").removeprefix("warning: ")]
    _, lines = run_tiny(path, tmp_path)
    assert not warned(lines)  # nobody asks for it


def test_frames_before_and_after_are_named(tmp_path, path):
    run_tiny(path, tmp_path, frames=3)
    assert outlook(path, tmp_path, TRACE) == "3 of 12 frames done; 0–2 without a trace: --fresh"
    _, lines = run_tiny(path, tmp_path, TRACE, frames=5)
    assert warned(lines) == [SAID.format("0–2")]
    run_tiny(path, tmp_path, frames=6)
    _, lines = run_tiny(path, tmp_path, TRACE)
    assert warned(lines) == [SAID.format("0–2, 5")]
    assert outlook(path, tmp_path, TRACE) == "12 frames; 0–2, 5 without a trace: --fresh"
    _, lines = run_tiny(path, tmp_path, TRACE, fresh=True)
    assert not warned(lines)
    assert outlook(path, tmp_path, TRACE) == "12 frames"
