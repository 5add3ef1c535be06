"""How far a stage is: counts, time left, silence of what is quick."""

from mocapflow.running import progress
from mocapflow.running.progress import Progress, clock


def told(monkeypatch, frames, *, seconds, first=1, brief=False):
    """The lines of a stage whose frames take some seconds each."""
    now, lines = [100.0], []
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    counter = Progress("track", lines.append, brief=brief)
    for done in range(first, frames + 1):
        now[0] += seconds
        counter.tell(done, frames, "at rest")
    return lines


def test_the_time_left_is_that_of_the_frames_so_far(monkeypatch):
    lines = told(monkeypatch, 5, seconds=30)
    assert lines[0] == "track: 1 of 5 frames, at rest"
    assert lines[1] == "track: 2 of 5 frames, 1:30 left, at rest"
    assert lines[-1] == "track: 5 of 5 frames, at rest"


def test_a_resumed_run_counts_its_own_frames(monkeypatch):
    assert told(monkeypatch, 1000, seconds=1, first=901)[1] == "track: 904 of 1000 frames, 1:36 left, at rest"


def test_lines_are_some_time_apart(monkeypatch):
    assert len(told(monkeypatch, 100, seconds=0.1)) == 5
    assert told(monkeypatch, 10, seconds=0.1) == ["track: 10 of 10 frames, at rest"]
    assert told(monkeypatch, 10, seconds=0.1, brief=True) == []


def test_a_clock():
    assert [clock(s) for s in (0.2, 59.6, 754, 3723)] == ["0:00", "1:00", "12:34", "1:02:03"]
