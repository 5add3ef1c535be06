"""Recordings that are disturbed on purpose: what becomes of pictures, and how later stages see it."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_robustness import disturbances
from mocapflow_robustness.corrupt import Corrupt, fitted
from mocapflow_robustness.events import Event
from mocapflow_robustness.occlusion import union
from mocapflow_robustness.sequential_reader import SequentialReader

from mocapflow.errors import RecordingError
from mocapflow.recordings.recording import open_recording
from mocapflow.running.runner import plan
from tests.fixtures.stores import STAGES, actions, load, run_tiny, write_pipeline, write_recording

FRAMES, GOOD = 12, ("cam01",)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("corrupt") / "clip", frames=FRAMES)


def images(recording, since=None):
    return {frame.index: frame.images for frame in recording.frames(since)}


def disturbed(clip, *events, **settings):
    return Corrupt(events=tuple(Event(**event) for event in events), **settings).run(open_recording(clip))


def equal(one, other):
    return all((a == b).all() for a, b in zip(one, other, strict=True))


def test_the_same_picture_becomes_the_same_whoever_asks(clip):
    everything = dict(noise=0.6, rectangles=(3, 8), stripe=0.1, stripe_centre=0.7)
    events = [dict(what="torn", first=2, count=2), dict(what="late", first=5, by=2, views=["cam02"])]
    one = disturbed(clip, *events, **everything)
    seen = images(one)
    for other in (images(one), images(one, since=6), images(disturbed(clip, *events, **everything), since=3)):
        assert all(equal(other[index], seen[index]) for index in other)
    assert equal(one.frame(7).images, seen[7])
    assert (images(one.seen_by(1))[7][0] == seen[7][1]).all()
    assert not equal(images(disturbed(clip, *events, seed=1, **everything))[0], seen[0])


def test_nothing_is_changed_by_default(clip):
    plain = images(open_recording(clip))
    assert all(equal(images(disturbed(clip))[index], plain[index]) for index in plain)


def test_noise_replaces_or_moves_values():
    rng, grey = np.random.default_rng(0), np.full((200, 200, 3), 128, np.uint8)
    replaced = (disturbances.noisy(grey, 0.6, "replaced", rng) != 128).any(axis=2)
    assert replaced.mean() == pytest.approx(0.6, abs=0.01)
    neighbours = np.corrcoef(replaced[:, 1:].ravel(), replaced[:, :-1].ravel())[0, 1]
    assert abs(neighbours) < 0.02
    added = disturbances.noisy(grey, 0.2, "added", rng).astype(int) - 128
    assert np.abs(added).max() == 51
    assert added.std() == pytest.approx(51 / np.sqrt(3), rel=0.02)


def test_rectangles_and_stripe():
    white, rng = np.full((100, 200, 3), 255, np.uint8), np.random.default_rng(1)
    behind = (disturbances.with_rectangles(white, (3, 8), rng) != 255).any(axis=2).mean()
    assert 3 * 0.05**2 < behind < 8 * 0.25**2
    rows = np.flatnonzero((disturbances.with_stripe(white, 0.1, 0.5) == 0).all(axis=(1, 2)))
    assert rows.tolist() == list(range(45, 55))


def test_noise_lies_under_a_stripe_or_over_it(clip):
    under, over = (images(disturbed(clip, noise=0.6, stripe=0.2, noise_over=over))[0][0] for over in (False, True))
    rows = slice(int(0.42 * len(under)), int(0.58 * len(under)))
    assert not under[rows].any()
    assert over[rows].any(axis=2).mean() == pytest.approx(0.6, abs=0.1)


def test_rectangles_are_as_many_and_as_large_as_asked():
    with pytest.raises(ValueError, match="at least, at most"):
        Corrupt(rectangles=(3, 1))
    white, rng = np.full((100, 200, 3), 255, np.uint8), np.random.default_rng(3)
    sides = []
    for _ in range(60):
        behind = (disturbances.with_rectangles(white, (1, 1), rng) != 255).any(axis=2)
        rows, columns = behind.any(axis=1), behind.any(axis=0)
        np.testing.assert_array_equal(behind, np.outer(rows, columns))
        sides.append([rows.mean(), columns.mean()])
    known = np.array(sides)[np.min(sides, axis=1) > 0]  # but for white ones
    assert len(known) > 50
    assert 0.05 <= known.min() < 0.08 and 0.22 < known.max() <= 0.25


@pytest.mark.parametrize(
    ("event", "source"),
    [
        (dict(what="frozen", first=5), (0, 4)),
        (dict(what="late", by=3), (0, 3)),
        (dict(what="late", by=9), (0, 0)),
        (dict(what="frozen"), (0, 0)),
        (dict(what="other_time", first=5, count=2, by=4), (0, 10)),
        (dict(what="other_time", first=5, count=6, by=4), (0, 2)),
        (dict(what="other_time", by=6), (0, 0)),  # to the end, which 6 + 6 is beyond
        (dict(what="other_camera"), (1, 6)),
    ],
)
def test_a_picture_from_elsewhere(clip, event, source):
    plain, found = images(open_recording(clip)), disturbed(clip, dict(views=GOOD, **event))
    camera, index = source
    assert (found.frame(6).images[0] == plain[index][camera]).all()
    assert (found.frame(6).images[1] == plain[6][1]).all()


def test_of_two_events_that_meet_the_later_one_in_the_list_counts(clip):
    late, black = dict(what="late"), dict(what="black", first=4, count=1)
    shown = [disturbed(clip, *events).frame(4).images[0].any() for events in ((late, black), (black, late))]
    assert shown == [False, True]


def test_a_picture_of_another_camera_has_the_size_of_this_one():
    assert fitted(np.zeros((4, 6, 3), np.uint8), np.zeros((8, 5, 3), np.uint8)).shape == (8, 5, 3)


def test_a_reader_goes_back_too(clip):
    reader = SequentialReader(open_recording(clip))
    assert [reader.at(index).index for index in (5, 7, 2, 2, 3)] == [5, 7, 2, 2, 3]


def test_one_camera_has_no_other(clip):
    whole = open_recording(clip)
    alone = replace(whole, views=whole.views[:1])
    with pytest.raises(RecordingError, match="there is no other camera"):
        Corrupt(events=[dict(what="other_camera")]).run(alone)


def test_a_picture_that_is_spoiled_or_missing(clip):
    plain = images(open_recording(clip))
    events = ["black", "torn", "covered", "dropped"]
    found = disturbed(clip, *(dict(what=what, first=2 * k, count=2, views=GOOD) for k, what in enumerate(events)))
    frames = {frame.index: frame for frame in found.frames()}
    assert not frames[0].images[0].any()
    assert (frames[2].images[0] != plain[2][0]).mean() > 0.5
    half = len(plain[4][0]) // 2
    assert (frames[4].images[0][:half] == plain[4][0][:half]).all()
    assert not frames[4].images[0][half:].any()
    assert frames[4].hidden[0][half:].all() and not frames[4].hidden[0][:half].any() and not frames[4].hidden[1].any()
    assert frames[2].hidden == ()
    assert frames[6].usable.tolist() == [False, True]
    assert not frames[6].images[0].any()
    again = Corrupt(noise=0.5).run(found).frame(6)
    assert frames[6].reasons == again.reasons == ("dropped", "") and not again.images[0].any()
    assert frames[8].usable.all()
    assert all(equal(frames[k].images[1:], plain[k][1:]) for k in frames)


def test_of_a_picture_that_is_another_there_are_no_keypoints(clip):
    (change,) = disturbed(clip, dict(what="late", views=GOOD)).changes
    frame = replace(open_recording(clip).frame(5), keypoints=(np.ones((2, 25, 3)),) * 2)
    assert [len(view) for view in change._disturbed(frame, ["cam01", "cam02"], {}).keypoints] == [0, 2]


def test_a_covered_picture_stays_hidden_where_it_was(clip):
    lower = dict(what="covered", first=3)
    once, twice = disturbed(clip, lower), Corrupt().run(disturbed(clip, lower))
    assert [frame.hidden_in(0) is not None for frame in twice.frames()] == [index >= 3 for index in range(FRAMES)]
    assert (twice.frame(5).hidden_in(0) == once.frame(5).hidden_in(0)).all()
    rows = [np.zeros((4, 2), bool) for _ in range(2)]
    rows[0][1], rows[1][2] = True, True
    assert union(rows[:1], rows[1:])[0][:, 0].tolist() == [False, True, True, False]
    assert union((), rows) == tuple(rows) == union(rows, ()) and union((), ()) == ()


def test_a_camera_that_is_not_there_is_named_by_a_plan_too(clip):
    event = dict(what="black", views=["cam03"])
    with pytest.raises(RecordingError, match="there is no camera 'cam03'"):
        disturbed(clip, event)
    with pytest.raises(RecordingError, match="there is no camera 'cam03'"):
        Corrupt(events=[event]).need(open_recording(clip))


def test_later_stages_see_it_and_its_settings_are_in_their_keys(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=6)
    path = write_pipeline(tmp_path, clip, stages={"corrupt": {"use": "corrupt", "noise": 0.5}, **STAGES})
    run_tiny(path, tmp_path, frames=4)
    everything = dict.fromkeys(("background", "start", "track", "smooth"), "hit")
    again, _ = run_tiny(path, tmp_path, frames=4)
    assert {label: made for label, made in actions(again).items() if label in everything} == everything
    lines = {line.label: line for line in plan(load(path, frames=6), store=tmp_path / "store.zarr")}
    assert lines["corrupt"].why == "changes frames as they are read"
    assert lines["track"].action == "resume"
    for change in ("stages.corrupt.seed=1", "stages.corrupt=null"):
        changed = {line.label: line.action for line in plan(load(path, change), store=tmp_path / "store.zarr")}
        assert changed["track"] == changed["background"] == "run"
