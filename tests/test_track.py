"""The track, saved frame by frame: resumed it is bitwise what it is uninterrupted."""

import gc
import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mocapflow.components import Recovery, Segmenter
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Frame, Pose
from mocapflow.errors import ComponentFailed, PipelineError
from mocapflow.loop import settle
from mocapflow.model import ClothedModel
from mocapflow.output_checks import InvalidOutput
from mocapflow.prediction import initial_state
from mocapflow.recordings.recording import Recording
from mocapflow.results import ImageFlow, ViewChecks
from mocapflow.running.runner import run
from mocapflow.scene import Scene
from mocapflow.storage.store import Store
from mocapflow.track import CoupledLoop, prepared
from tests.fixtures.stores import STAGES, actions, load, run_tiny, same, the_track, write_pipeline, write_recording

SHORT = {name: STAGES[name] for name in ("start", "track")}
KILLS = Path(__file__).parent / "fixtures" / "kills.py"


@pytest.mark.usefixtures("ran")
def test_a_track_has_every_frame_and_says_how_it_went(tmp_path):
    track = the_track(tmp_path)
    assert track.frame.tolist() == list(range(12))
    assert track.cloth.shape == (12, 4, 3)
    assert track.cloth_parameters.shape == (12, 1)
    assert track.covariance.shape == (12, 8, 8)
    assert track.step_names == ("decode", "predict", "drape", "segment", "solve", "cloth", "energy", "recover")
    assert track.seconds.shape == (12, 8)
    assert (track.seconds.sum(axis=1) > 0).all()
    assert set(track.iterations) <= {2, 3, 4}
    assert track.notes == ()


@pytest.mark.long
def test_twenty_deaths_in_the_middle_of_writes_change_nothing(tmp_path):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT)
    run_tiny(path, tmp_path / "whole")
    (tmp_path / "broken").mkdir()
    command = [sys.executable, str(KILLS), str(path), str(tmp_path / "broken"), "1"]
    said = subprocess.run(command, capture_output=True, text=True, check=True, cwd=KILLS.parents[2])
    saved = json.loads(said.stdout.splitlines()[-1])
    assert len(saved) >= 20
    assert sorted(saved) == saved  # nothing was lost
    assert len(set(saved)) > 5
    assert same(the_track(tmp_path / "whole"), the_track(tmp_path / "broken"))


@pytest.mark.long
def test_twenty_real_kills_change_nothing(tmp_path):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip", frames=200))
    run_tiny(path, tmp_path / "whole")
    (tmp_path / "broken").mkdir()
    environment = os.environ | {"TINY_SLOW": "0.02"}
    dice, killed, frames = random.Random(2), 0, []
    while killed < 20:
        command = [sys.executable, str(KILLS.with_name("stores.py")), str(path), str(tmp_path / "broken")]
        running = subprocess.Popen(command, cwd=KILLS.parents[2], env=environment, stderr=subprocess.DEVNULL)
        store = Store(tmp_path / "broken" / "store.zarr")
        before = frames[-1] if frames else 0
        while running.poll() is None and count(store) <= before:  # let it get to work, then strike at any moment
            time.sleep(0.01)
        time.sleep(dice.uniform(0, 0.3))
        running.send_signal(signal.SIGKILL)
        killed += running.wait() == -signal.SIGKILL
        frames.append(count(store))
        assert frames[-1] >= before
    run_tiny(path, tmp_path / "broken")
    assert len(set(frames)) >= 15, frames
    assert same(the_track(tmp_path / "whole"), the_track(tmp_path / "broken"))


def count(store):
    return max((a.frames for a in store.artifacts() if a.path.name.startswith("track-")), default=0)


@pytest.mark.long
def test_growing_stop_continues(tmp_path, path, whole):
    for frames in (1, 2, 5, 12):
        _, lines = run_tiny(path, tmp_path / "grown", frames=frames)
        assert len(the_track(tmp_path / "grown").frame) == frames
    assert "track: going on after 5 frames" in lines
    assert same(the_track(whole), the_track(tmp_path / "grown"))


def test_a_run_of_every_third_frame_goes_on_with_every_third(tmp_path, path):
    for stop in (6, 12):
        pipeline = load_pipeline(path, frames=slice(0, stop, 3))
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    assert the_track(tmp_path).frame.tolist() == [0, 3, 6, 9]


def test_a_smaller_stop_reads_the_first_frames(tmp_path, ran):
    summary, _ = run_tiny(ran, tmp_path, frames=5)
    assert next(s for s in summary.stages if s["label"] == "track")["cached"]
    assert len(json.loads((tmp_path / "out" / "results.json").read_text())["angles"]) == 5


def test_a_smaller_stop_has_the_notes_of_its_frames_only(tmp_path, path):
    for index in (1, 4):
        (tmp_path / "clip" / "videos" / "cam02" / f"{index:06}.png").unlink()
    run_tiny(path, tmp_path)
    store = Store(tmp_path / "store.zarr")
    (found,) = [a for a in store.artifacts() if a.path.name.startswith("track-")]
    short, longer = (store.load(found, frames).notes for frames in (3, 5))
    assert {note.partition(":")[0] for note in longer} == {"frame 1", "frame 4"}
    assert short == tuple(note for note in longer if note.startswith("frame 1:"))


@pytest.mark.long
def test_a_smaller_stop_than_what_is_half_done(tmp_path, path, monkeypatch, whole):
    monkeypatch.setenv("TINY_RAISE_AT", "8")
    with pytest.raises(ComponentFailed):
        run_tiny(path, tmp_path)
    run_tiny(path, tmp_path, frames=5)
    assert len(json.loads((tmp_path / "out" / "results.json").read_text())["angles"]) == 5
    monkeypatch.delenv("TINY_RAISE_AT")
    run_tiny(path, tmp_path)
    assert same(the_track(whole), the_track(tmp_path))


def test_a_component_that_raises_is_named_and_the_run_goes_on_there(tmp_path, path, monkeypatch, whole):
    monkeypatch.setenv("TINY_RAISE_AT", "7")
    with pytest.raises(ComponentFailed) as raised:
        run_tiny(path, tmp_path)
    log = tmp_path / "out" / "failed.log"
    assert str(raised.value) == (
        f"segmenter 'tiny_segmenter' ({origin(path)}) failed at frame 7, iteration 1: "
        "FloatingPointError: spring force overflow\n"
        "       frames 0–6 are saved; run the same command to continue at 7\n"
        f"       traceback: {log}"
    )
    assert raised.value.exit_status == 1
    assert "spring force overflow" in log.read_text()
    monkeypatch.delenv("TINY_RAISE_AT")
    _, lines = run_tiny(path, tmp_path)
    assert "track: going on after 7 frames" in lines
    assert same(the_track(whole), the_track(tmp_path))


def test_a_track_whose_first_frame_failed_is_begun_again(tmp_path, path, monkeypatch, whole):
    monkeypatch.setenv("TINY_RAISE_AT", "0")
    with pytest.raises(ComponentFailed, match="no frame is saved yet; run the same command to start again"):
        run_tiny(path, tmp_path)
    monkeypatch.delenv("TINY_RAISE_AT")
    _, lines = run_tiny(path, tmp_path)
    assert not any("going on after" in line for line in lines)
    assert same(the_track(whole), the_track(tmp_path))


def test_a_frame_that_cannot_be_read_is_not_told_as_the_one_before(tmp_path, path, monkeypatch):
    write_pipeline(tmp_path, tmp_path / "clip", stages=SHORT)
    real = Recording.frames

    def breaking(self, since=None):
        for frame in real(self, since):
            if frame.index == 4:
                raise FloatingPointError("torn")
            yield frame

    monkeypatch.setattr(Recording, "frames", breaking)
    with pytest.raises(ComponentFailed, match=r"failed: FloatingPointError: torn\n *frames 0–3 are saved"):
        run_tiny(path, tmp_path)


def test_after_a_fresh_run_going_on_needs_a_run_that_is_not(tmp_path, path, monkeypatch):
    monkeypatch.setenv("TINY_RAISE_AT", "3")
    with pytest.raises(ComponentFailed, match="run the same command without --fresh to continue at 3"):
        run_tiny(path, tmp_path, fresh=True)


def origin(path):
    pipeline = load(path)
    track = next(named.stage for named in pipeline.stages if named.label == "track")
    return pipeline.registry.origin(type(track.segmenter))


@pytest.mark.long
def test_lost_frames_keep_the_prediction_and_say_so(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=9, cameras=3)
    for camera, frame in [("cam01", 3), ("cam01", 4), ("cam02", 4), ("cam01", 5), ("cam02", 5), ("cam03", 5)]:
        (clip / "videos" / camera / f"{frame:06}.png").write_bytes(b"")
    path = write_pipeline(tmp_path, clip)
    run_tiny(path, tmp_path)
    track = the_track(tmp_path)
    assert len(track.frame) == 9
    assert track.usable[3:6].tolist() == [[False, True, True], [False, False, True], [False, False, False]]
    assert (track.iterations == 0).tolist() == [False] * 4 + [True, True] + [False] * 3
    assert np.allclose(track.root[4], track.root[3] @ np.linalg.inv(track.root[2]) @ track.root[3])  # the prediction
    assert [note for note in track.notes if "lost" in note] == [
        "frame 4: lost, fewer than 2 views; the prediction is kept",
        "frame 5: lost, fewer than 2 views; the prediction is kept",
    ]
    assert sum(note.startswith("frame 3: cam01 not usable: ") for note in track.notes) == 1
    assert [note for note in track.notes if "anew" in note] == [
        "frame 6: begun anew, like a first frame: the frames before do not show the person"
    ]
    run_tiny(path, tmp_path / "two", frames=5)  # resumed between lost frames
    run_tiny(path, tmp_path / "two")
    assert same(track, the_track(tmp_path / "two"))


@pytest.fixture
def begun(monkeypatch):
    """The frames that were settled, each time with how many before it were known."""
    settled = []

    def spy(frame, state, past, *rest):
        settled.append((frame.index, len(past.moments)))
        return settle(frame, state, past, *rest)

    monkeypatch.setattr("mocapflow.track.settle", spy)
    return settled


def test_the_first_segmenter_settles_frames_before_which_no_velocity_is_known(tmp_path, begun):
    stages = SHORT | {"track": SHORT["track"] | {"first_segmenter": "tiny_segmenter"}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=4)
    once = [(0, 0), (1, 1), (2, 2), (3, 3)]
    assert list(dict.fromkeys(begun)) == once
    assert [frame for frame in once if begun.count(frame) > 1] == once[:2]


@pytest.mark.parametrize(("cost", "helps"), [(0.0, True), (1.0, False), (2.0, False)])
def test_what_the_first_segmenter_finds_is_kept_where_images_fit_better_from_there(tmp_path, monkeypatch, cost, helps):
    begins, turns, costs = [], [], iter([1.0, cost])

    def spy(frame, state, past, steps, *rest):
        begins.append(state)
        turns.append((steps.segmenter.sigma_px, steps.steady.max_turns))
        return settle(frame, state, past, steps, *rest)

    monkeypatch.setattr("mocapflow.track.settle", spy)
    monkeypatch.setattr("mocapflow.track.image_cost", lambda *energy: next(costs))
    stages = SHORT | {"track": SHORT["track"] | {"first_segmenter": {"use": "tiny_segmenter", "sigma_px": 3}}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=1)
    given, stayed, approached, kept = begins
    assert stayed is given
    assert kept is (approached if helps else given)
    assert turns == [(3, 4), (2, 1), (2, 1), (2, 4)]  # where the images fit better is seen in one turn


@pytest.mark.parametrize("costs", [(1.0, 3.0, 2.0), (3.0, 2.0, 1.0)])
def test_of_the_poses_that_a_start_leaves_open_the_one_that_fits_best_begins(tmp_path, monkeypatch, begun, costs):
    """Each is tried on the first frame, and on no other."""
    told, begins = iter(costs), []
    monkeypatch.setattr("mocapflow.track.image_cost", lambda *energy: next(told))
    monkeypatch.setattr(
        "mocapflow.track.initial_state", lambda *state: begins.append(state[0]) or initial_state(*state)
    )
    stages = SHORT | {"start": {"use": "tiny_start", "others": 2}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=2)
    assert begun == [(0, 0)] * 4 + [(1, 1)]
    assert begins[3] is begins[int(np.argmin(costs))]


def test_of_the_poses_that_a_start_leaves_open_one_that_is_doubted_comes_last(tmp_path, monkeypatch):
    costs, begins = iter([1.0, 3.0, 2.0]), []

    def doubting(frame, state, *rest):
        begins.append(state.estimate.pose)
        return replace(settle(frame, state, *rest), doubted=len(begins) == 1)

    monkeypatch.setattr("mocapflow.track.image_cost", lambda *energy: next(costs))
    monkeypatch.setattr("mocapflow.track.settle", doubting)
    stages = SHORT | {"start": {"use": "tiny_start", "others": 2}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=1)
    assert begins[3] is begins[2]


def test_the_cloth_of_a_prediction_is_laid_by_all_that_is_known_of_it(tmp_path, monkeypatch):
    laid, begun, real = [], [], ClothedModel.drape

    def drape(self, pose, parameters, past):
        laid.append(len(past.moments))
        return real(self, pose, parameters, past)

    def spy(*given):
        begun.append(laid[-1])
        return settle(*given)

    monkeypatch.setattr(ClothedModel, "drape", drape)
    monkeypatch.setattr("mocapflow.track.settle", spy)
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT), tmp_path, frames=5)
    assert begun == [0, 1, 2, 3, 3]


@pytest.mark.parametrize("without", [True, False])
def test_a_first_segmenter_that_needs_the_empty_scene_is_left_out_without(
    tmp_path, monkeypatch, begun, caplog, without
):
    monkeypatch.setattr(Segmenter, "needs_background", without)
    stages = SHORT | {"track": SHORT["track"] | {"first_segmenter": "tiny_segmenter"}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=1)
    assert (begun.count((0, 0)) == 1) is without
    assert ("first_segmenter tiny_segmenter needs the empty scene" in caplog.text) is without


def test_a_recovery_that_needs_the_empty_scene_is_not_asked_without(tmp_path, caplog):
    stages = SHORT | {"track": SHORT["track"] | {"recovery": "limb_search"}}
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages), tmp_path, frames=1)
    assert "recovery limb_search needs the empty scene, which no stage before makes: it is not asked" in caplog.text


def test_the_first_frame_that_shows_the_person_begins_like_a_first(tmp_path, begun):
    """However many lost frames come before it: with the first segmenter, and without a past."""
    clip = write_recording(tmp_path / "clip", frames=8)
    for index in (0, 1, 4, 5):
        (clip / "videos" / "cam01" / f"{index:06}.png").write_bytes(b"")
    stages = SHORT | {"track": SHORT["track"] | {"first_segmenter": "tiny_segmenter"}}
    path = write_pipeline(tmp_path, clip, stages=stages)
    run_tiny(path, tmp_path)
    assert list(dict.fromkeys(begun)) == [(2, 0), (3, 3), (6, 0), (7, 3)]
    assert [frame for frame in dict.fromkeys(begun) if begun.count(frame) > 1] == [(2, 0), (6, 0)]
    assert [note for note in the_track(tmp_path).notes if "anew" in note] == [
        f"frame {index}: begun anew, like a first frame: the frames before do not show the person" for index in (2, 6)
    ]


def test_a_recovery_gets_the_prediction_and_only_what_is_trusted(tmp_path, monkeypatch):
    begins, given, costs = [], [], itertools.cycle([1.0, 0.0])  # the first segmenter always helps

    def begin(*state):
        begins.append(initial_state(*state))
        return begins[-1]

    def recovered(self, frame, state, result, past, model):
        given.append((frame.index, state, len(past.moments)))
        return result

    monkeypatch.setattr("mocapflow.track.initial_state", begin)
    monkeypatch.setattr("mocapflow.track.image_cost", lambda *energy: next(costs))
    monkeypatch.setattr(CoupledLoop, "recovered", recovered)
    clip = write_recording(tmp_path / "clip", frames=3)
    for index in (0, 1):
        (clip / "videos" / "cam01" / f"{index:06}.png").write_bytes(b"")
    stages = SHORT | {"track": SHORT["track"] | {"first_segmenter": "tiny_segmenter"}}
    run_tiny(write_pipeline(tmp_path, clip, stages=stages), tmp_path)
    assert len(begins) == 4  # one more near the person, at frame 2
    assert given == [(2, begins[2], 0)]


def test_what_a_recovery_tries_knows_what_was_before(tmp_path, monkeypatch):
    known = []

    def spy(frame, state, past, *rest):
        known.append(len(past.moments))
        return settle(frame, state, past, *rest)

    def recovered(self, frame, state, result, past, model):
        return self.settled(frame, past, model, state.estimate.pose, state.cloth.parameters)

    monkeypatch.setattr("mocapflow.track.settle", spy)
    monkeypatch.setattr(CoupledLoop, "recovered", recovered)
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT), tmp_path, frames=3)
    assert known == [0, 0, 1, 1, 2, 2]


def test_a_predictor_that_returns_no_pose_is_named(tmp_path, path, monkeypatch):
    pipeline = load(path)
    (loop,) = (named.stage for named in pipeline.stages if named.label == "track")
    monkeypatch.setattr(type(loop.predictor), "predict", lambda *_: Pose(root=np.eye(4), angles=np.full(2, np.nan)))
    with pytest.raises(ComponentFailed, match=r"^predictor 'tiny_predictor' .* failed at frame 1: it returned "):
        run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")


def test_a_recovery_that_returns_no_result_is_named():
    class Nothing(Recovery):
        name = "nothing"

        def recover(self, *_):
            return None

    loop = SimpleNamespace(recovery=Nothing(), settled=print)
    with pytest.raises(InvalidOutput):
        CoupledLoop.recovered(loop, *[None] * 4, SimpleNamespace(scene=None))


def test_a_frame_is_tracked_without_wrong_views_and_with_the_flow_into_it():
    image, index = np.zeros((4, 6, 3), np.uint8), np.array([7], np.int32)
    frame = Frame(index=7, time=0.2, images=(image, image), usable=np.array([True, True]))
    checks = ViewChecks(frame=index, camera=np.array([1], np.int16), reasons=("torn",))
    moved = np.ones((1, 2), np.float32)
    flow = ImageFlow(frame=index, camera=np.array([0], np.int16), pixel=moved, displacement=moved, cameras=2)
    seen = prepared(frame, checks, flow)
    assert seen.usable.tolist() == [True, False]
    assert [len(view.pixel) for view in seen.flow] == [1, 0]
    assert prepared(frame, None, None) is frame


def test_a_frame_begins_with_the_cloth_of_the_last_and_keeps_its_notes(tmp_path, monkeypatch):
    begun = []

    def noted(frame, state, *rest):
        begun.append(state.estimate.parameters)
        return replace(settle(frame, state, *rest), notes=("odd",) if frame.index == 2 else ())

    monkeypatch.setattr("mocapflow.track.settle", noted)
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT), tmp_path, frames=5)
    track = the_track(tmp_path)
    np.testing.assert_array_equal(begun[1:], track.cloth_parameters[:-1])
    assert len(np.unique(track.cloth_parameters)) == 5
    assert track.notes == ("frame 2: odd",)


def test_what_frames_have_shown_is_known_after_a_lost_one(tmp_path, monkeypatch):
    known = {}

    def spy(frame, state, past, *rest):
        known[frame.index] = set(past.appearance)
        return settle(frame, state, past, *rest)

    monkeypatch.setattr("mocapflow.track.settle", spy)
    clip = write_recording(tmp_path / "clip", frames=3)
    (clip / "videos" / "cam01" / "000001.png").write_bytes(b"")
    run_tiny(write_pipeline(tmp_path, clip, stages=SHORT), tmp_path)
    assert known == {0: set(), 2: {"grey", "count"}}


def test_a_frame_that_shows_nobody_says_so(tmp_path, monkeypatch):
    def empty(frame, *rest):
        result = settle(frame, *rest)
        if frame.index != 2:
            return result
        estimate = replace(result.state.estimate, observed=np.zeros(2))
        return replace(result, state=replace(result.state, estimate=estimate))

    monkeypatch.setattr("mocapflow.track.settle", empty)
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT), tmp_path, frames=4)
    assert the_track(tmp_path).notes == ("frame 2: no view shows the person; the prediction is kept",)


def test_a_doubted_frame_is_kept_as_such(tmp_path, monkeypatch):
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT)

    def doubting(frame, state, past, *rest):
        return replace(settle(frame, state, past, *rest), doubted=frame.index == 2)

    monkeypatch.setattr("mocapflow.track.settle", doubting)
    run_tiny(path, tmp_path, frames=4)
    assert the_track(tmp_path).doubted.tolist() == [False, False, True, False]
    run_tiny(path, tmp_path, frames=6)
    assert the_track(tmp_path).doubted.tolist() == [False, False, True, False, False, False]


@pytest.mark.long
def test_without_a_garment_there_is_no_cloth(tmp_path):
    stages = STAGES | {"track": STAGES["track"] | {"draper": None, "cloth_fitter": None}}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), garment=None, stages=stages)
    run_tiny(path, tmp_path, frames=5)
    run_tiny(path, tmp_path)
    assert the_track(tmp_path).cloth.shape == (12, 0, 3)
    run_tiny(path, tmp_path / "whole")
    assert same(the_track(tmp_path / "whole"), the_track(tmp_path))


def test_a_garment_that_nothing_drapes_is_refused(tmp_path):
    stages = STAGES | {"track": STAGES["track"] | {"draper": None, "cloth_fitter": None}}
    path = write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=stages)
    with pytest.raises(PipelineError, match="wears a .*, which the track does not drape(.|\n)*garment: null"):
        run_tiny(path, tmp_path, frames=5)


def test_on_unsteady_stop(tmp_path, path):
    said = r"frame 0 did not come to rest in 2 turns: .* mm and .*° in the last turn\n *the frame is saved; "
    with pytest.raises(ComponentFailed, match=said):
        run_tiny(path, tmp_path, "stages.track.on_unsteady=stop", "stages.track.steady.max_turns=2")
    _, lines = run_tiny(path, tmp_path, "stages.track.steady.max_turns=2")
    assert "track: going on after 1 frames" in lines


def test_on_unsteady_stop_leaves_frames_alone_that_are_not_asked_for(tmp_path, path, monkeypatch):
    turns = "stages.track.steady.max_turns=5"  # frame 2 is the first that does not come to rest in them
    monkeypatch.setenv("TINY_RAISE_AT", "3")
    with pytest.raises(ComponentFailed, match="frames 0–2 are saved"):
        run_tiny(path, tmp_path, turns)
    with pytest.raises(ComponentFailed, match="frame 2 did not come to rest"):
        run_tiny(path, tmp_path, turns, "stages.track.on_unsteady=stop", frames=3)
    run_tiny(path, tmp_path, turns, "stages.track.on_unsteady=stop", frames=2)


def test_on_unsteady_stop_does_not_stop_at_a_lost_frame(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=4)
    (clip / "videos" / "cam01" / "000001.png").write_bytes(b"")
    path = write_pipeline(tmp_path, clip, stages=SHORT)
    for action in ("run", "hit"):
        summary, _ = run_tiny(path, tmp_path, "stages.track.steady.max_turns=20", "stages.track.on_unsteady=stop")
        assert actions(summary)["track"] == action
    assert the_track(tmp_path).steady.tolist() == [True, False, True, True]


@pytest.mark.parametrize("frames", [5, None])
def test_on_unsteady_stop_also_holds_for_frames_of_the_store(tmp_path, path, frames):
    run_tiny(path, tmp_path, "stages.track.steady.max_turns=2", frames=5)
    stop = ("stages.track.steady.max_turns=2", "stages.track.on_unsteady=stop")
    for _ in range(2):
        with pytest.raises(ComponentFailed, match="frame 0 did not come to rest in 2 turns") as caught:
            run_tiny(path, tmp_path, *stop, frames=frames)
        assert caught.value.hint.startswith("the frame is saved; on_unsteady: go_on continues after it")
    assert len(the_track(tmp_path).frame) == 5
    summary, _ = run_tiny(path, tmp_path, stop[0], frames=5)
    assert actions(summary)["track"] == "hit"


def test_each_frame_has_its_own_seconds(tmp_path, monkeypatch):
    ticks = itertools.count()
    monkeypatch.setattr("mocapflow.timing.time", SimpleNamespace(process_time=lambda: next(ticks)))
    run_tiny(write_pipeline(tmp_path, write_recording(tmp_path / "clip"), stages=SHORT), tmp_path, frames=3)
    track = the_track(tmp_path)
    assert (track.seconds[:, :3] == [1, 2, 1]).all()  # decode; predict, also to come near; drape
    assert (track.seconds[:, 3] == track.iterations).all()


def test_a_body_of_more_faces_is_tracked_with_as_many_as_wanted(tmp_path, path, monkeypatch):
    wanted = []
    monkeypatch.setattr(Scene, "simplified", lambda self, faces: wanted.append(faces) or self)
    run_tiny(path, tmp_path, "stages.track.body_faces=2345", frames=1)
    assert wanted == [2345]


def test_keep_trace_keeps_every_turn(tmp_path, path, whole):
    import zarr

    run_tiny(path, tmp_path, "stages.track.keep=trace")
    (found,) = (tmp_path / "store.zarr").glob("track-*")
    turns = zarr.open_group(str(found), mode="r")["trace"][...]
    track = the_track(tmp_path)
    assert turns.shape == (12, 4, 18)
    assert (np.isfinite(turns).all(axis=2).sum(axis=1) == track.iterations).all()
    last = turns[np.arange(12), track.iterations - 1]
    assert np.array_equal(last[:, 16:], track.angles)
    assert same(track, the_track(whole))  # which kept none


@pytest.mark.long
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=3000, video=True)
    pipeline = load(write_pipeline(tmp_path, clip, stages=SHORT), "stages.track.steady.max_turns=1")
    # pathlib interns names: once in a while Python lays its table of them anew, some MB that count as new
    own = [tracemalloc.Filter(False, pattern) for pattern in ("*/pathlib.py", "*/pathlib/*")]
    traced = {}

    def frame_done(index, result):
        if index in {300, 2990}:
            gc.collect()
            traced[index] = sum(
                each.size for each in tracemalloc.take_snapshot().filter_traces(own).statistics("filename")
            )

    pipeline.registry.observers.frame_done = frame_done
    tracemalloc.start()
    run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    tracemalloc.stop()
    assert traced[2990] - traced[300] < 50_000, traced  # bytes, over 2,690 frames
