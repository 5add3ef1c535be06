"""A long recording in parts: which frames each has, how they are wired, what is kept and what is made."""

import numpy as np
import pytest

from mocapflow.errors import PipelineError
from mocapflow.running.parts import in_parts, split
from mocapflow.running.runner import plan, prepare, run
from mocapflow.running.wiring import wire
from tests.fixtures.stores import STAGES, actions, load, run_tiny, write_pipeline, write_recording

IN_TWO = ("parts.count=2", "parts.overlap=3")


@pytest.fixture
def path(tmp_path):
    return write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=20))


def test_parts_cover_the_recording_and_share_frames():
    parts = split(range(10, 1010, 2), 4, 30)
    assert parts == [range(10, 260, 2), range(200, 510, 2), range(450, 760, 2), range(700, 1010, 2)]
    assert split(range(7), 2, 2) == [range(4), range(2, 7)]
    with pytest.raises(PipelineError, match="100 frames are too few for 4 parts that share 25"):
        split(range(100), 4, 25)


def test_a_part_has_its_own_start_and_others_see_the_whole(path):
    pipeline = in_parts(load(path, *IN_TWO), range(20))
    assert [named.label for named in pipeline.stages] == [
        "background", "start", "track_1", "start_2", "track_2", "track", "smooth", "export",
    ]  # fmt: skip
    wiring = wire(pipeline)
    assert wiring["track_1"]["start"] == "start"
    assert wiring["track_2"]["start"] == "start_2"
    assert wiring["track_2"]["background"] == "background"
    assert wiring["track"] == {"parts": ("track_1", "track_2"), "scene": "scene"}
    assert wiring["smooth"]["track"] == "track"


@pytest.mark.long
def test_each_of_two_tracks_is_joined_of_its_own_parts(tmp_path):
    stages = {label: STAGES[label] for label in ("background", "start")}
    stages |= {"first": STAGES["track"], "track": STAGES["track"], "smooth": "tiny_smooth", "export": "tiny_export"}
    clip = write_recording(tmp_path / "clip", frames=20)
    path = write_pipeline(tmp_path, clip, stages=stages)
    pipeline = in_parts(load(path, *IN_TWO), range(20))
    labels, wiring = [named.label for named in pipeline.stages], wire(pipeline)
    assert labels.count("start_2") == 1 and wiring["track_2"]["start"] == "start_2"
    assert wiring["first"]["parts"] == ("first_1", "first_2")
    assert wiring["track"]["parts"] == ("track_1", "track_2")
    run_tiny(path, tmp_path, *IN_TWO, "stages.first.steady.max_turns=2")  # parts of both would not fit together


def test_a_stage_with_the_label_of_a_part_is_refused(tmp_path):
    stages = {"background": "tiny_background", "start": "tiny_start", "start_2": "tiny_start", "track": STAGES["track"]}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=20), stages=stages)
    wired = "stages.track.from={start: start}"
    with pytest.raises(PipelineError, match="no stage can be called 'start_2': a part has that name"):
        in_parts(load(path, *IN_TWO, wired), range(20))


def test_another_stage_starts_the_later_parts(path):
    pipeline = in_parts(load(path, *IN_TWO, "parts.start={use: tiny_start, angle_rad: 1.0}"), range(20))
    assert [named.stage.angle_rad for named in pipeline.stages if named.label.startswith("start")] == [0.0, 1.0]


def test_what_is_to_start_the_later_parts_makes_a_start(path):
    pipeline = in_parts(load(path, *IN_TWO, "parts.start=tiny_background"), range(20))
    with pytest.raises(PipelineError, match="wants its start from 'start_2', but no earlier 'start_2' makes one"):
        wire(pipeline)


def test_one_part_is_the_whole(path):
    pipeline = load(path, "parts.count=1", "parts.overlap=50")
    assert in_parts(pipeline, range(20)) is pipeline


@pytest.mark.long
def test_parts_are_made_resumed_and_joined(tmp_path, path):
    store = tmp_path / "store.zarr"
    run_tiny(path, tmp_path, frames=13)  # the first part of the whole: its frames serve both
    pipeline = load(path, *IN_TWO)
    assert {line.label: line.action for line in plan(pipeline, store=store)}["track_1"] == "hit"
    chains = [step.label for step in prepare(pipeline, store=store).steps if step.chain]
    assert chains == ["track_1", "track_2"]
    only = run(pipeline, store=store, out=tmp_path / "out", only="track_2")
    assert actions(only) == {"background": "hit", "start_2": "run", "track_2": "run"}
    summary, _ = run_tiny(path, tmp_path, *IN_TWO)
    assert actions(summary) == {
        "background": "hit", "start": "hit", "track_1": "hit", "start_2": "hit", "track_2": "hit",
        "track": "run", "smooth": "run", "export": "run",
    }  # fmt: skip
    again, _ = run_tiny(path, tmp_path, *IN_TWO)
    assert actions(again)["track"] == "hit"
    assert "track_1 track_2" in str(next(line for line in plan(pipeline, store=store) if line.label == "track"))


def test_frames_of_a_part_are_those_of_its_own_track(tmp_path, path):
    pipeline = load(path, *IN_TWO)
    run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    from mocapflow.storage.store import Store

    store = Store(tmp_path / "store.zarr")
    found = {
        a.path.name.rpartition("-")[0]: store.load(a) for a in store.artifacts() if a.path.name.startswith("track")
    }
    joined, first, second = found["track"], found["track_1"], found["track_2"]
    assert joined.frame.tolist() == list(range(20))
    assert (first.frame.tolist(), second.frame.tolist()) == (list(range(10)), list(range(7, 20)))
    (note,) = [note for note in joined.notes if "joined" in note]
    seam = int(note.split()[1].rstrip(":"))
    assert 7 <= seam <= 9
    np.testing.assert_array_equal(joined.angles[:seam], first.angles[:seam])
    np.testing.assert_array_equal(joined.angles[seam:], second.angles[seam - 7 :])
