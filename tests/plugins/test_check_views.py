"""Wrong pictures among right ones: which are found, and that motion is not taken for one."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from mocapflow_robustness import check_views
from mocapflow_robustness.check_views import CheckViews
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.events import Event
from mocapflow_robustness.picture_checks import blank, bursts, interpolated
from mocapflow_robustness.thumbnails import thumbnails

from mocapflow.data import Frame
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ViewChecks
from tests.fixtures.stores import STAGES, load, run_tiny, the_track, write_pipeline, write_recording

FRAMES, CAMERAS, HEIGHT, WIDTH = 60, 3, 16, 24
EVENTS = {
    "black": "shows nothing",
    "torn": "does not fit",
    "frozen": "repeats the one before",
    "other_time": "does not fit",
    "other_camera": "looks like one of",
}


def rooms():
    noise = np.random.default_rng(0).uniform(0, 255, (CAMERAS, HEIGHT, WIDTH)).astype(np.float32)
    smooth = [128 + 6 * (cv2.GaussianBlur(room, (0, 0), 3) - 128) for room in noise]
    return [np.repeat(room[..., None], 3, axis=2) for room in smooth]


def picture(room, camera, index):
    """A bright ball that goes round in a room, seen with a little noise."""
    phase = 2 * np.pi * index / 40 + camera
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    near = np.hypot(row - 8 - 5 * np.sin(phase), column - 12 - 8 * np.cos(phase / 2)) < 2.5
    noise = np.random.default_rng([camera, index]).normal(0, 2, room.shape)
    return np.clip(np.where(near[..., None], 230, room) + noise, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = write_recording(tmp_path_factory.mktemp("checks") / "clip", frames=FRAMES, cameras=CAMERAS)
    for camera, room in enumerate(rooms()):
        for index in range(FRAMES):
            cv2.imwrite(str(folder / f"videos/cam{camera + 1:02}/{index:06}.png"), picture(room, camera, index))
    return folder


def found(clip, *events):
    recording = Corrupt(events=tuple(Event(**event) for event in events)).run(open_recording(clip))
    checks = CheckViews().run(recording)
    return {(int(f), int(c)): why for f, c, why in zip(checks.frame, checks.camera, checks.reasons, strict=True)}


def test_nothing_is_wrong_with_a_clean_recording(clip):
    assert found(clip) == {}


@pytest.mark.parametrize("what", EVENTS)
@pytest.mark.parametrize("views", [("cam02",), ()], ids=["one view", "all views"])
def test_wrong_pictures_are_found(clip, what, views):
    if what == "frozen" and not views:
        pytest.skip("nobody can tell that from a person who stands still")
    told = found(clip, dict(what=what, first=25, count=3, views=views, by=13))
    cameras = (1,) if views else range(CAMERAS)
    assert set(told) == {(index, camera) for index in (25, 26, 27) for camera in cameras}
    assert all(EVENTS[what] in why for why in told.values())


def test_several_things_at_once(clip):
    told = found(
        clip,
        dict(what="black", first=20, count=2, views=["cam01"]),
        dict(what="torn", first=26, count=2, views=["cam01"]),
        dict(what="other_camera", first=40, views=["cam03"]),
        dict(what="dropped", first=10, count=5, views=["cam02"]),
    )
    assert {index for index, camera in told if camera == 0} == {20, 21, 26, 27}
    assert {index for index, camera in told if camera == 2} == set(range(40, FRAMES))
    assert {why for (_, camera), why in told.items() if camera == 2} == {"the picture looks like one of cam01"}
    assert not any(camera == 1 for _, camera in told)


def test_a_reason_ends_where_the_name_of_its_camera_does(clip):
    recording = Corrupt(events=(Event(what="other_camera", first=40, views=("cam03",)),)).run(open_recording(clip))
    names = ["the camera behind the door on the left side", "b", "c"]
    said = check_views.faults(thumbnails(recording), check_views.rooms(thumbnails(recording), None), 30.0, names)
    assert said[45, 2] == f"the picture looks like one of {names[0]}"


def test_a_frozen_view_is_found_beside_missing_pictures(clip):
    """A missing picture is black: nothing differs more from the room, and it says nothing of what is usual."""
    missing = dict(what="dropped", first=5, count=8, views=["cam02"])
    told = found(clip, dict(what="frozen", first=25, count=3, views=["cam02"]), missing)
    assert set(told) == {(index, 1) for index in (25, 26, 27)}


@pytest.mark.parametrize("first", [10, 0], ids=["most", "all"])
def test_most_of_a_view_may_be_missing(clip, first):
    assert found(clip, dict(what="dropped", first=first, views=["cam02"])) == {}


def test_a_view_that_shows_one_picture_from_first_to_last(clip):
    """Its first picture may be true."""
    told = found(clip, dict(what="frozen", first=0, views=["cam02"]))
    assert told == {(index, 1): "the picture repeats the one before" for index in range(1, FRAMES)}


@pytest.mark.parametrize("first", [6, 25, 50])
def test_a_view_that_hangs_for_good(clip, first):
    """After more than half of the frames its picture is what a median over time takes for the empty room."""
    told = found(clip, dict(what="frozen", first=first, views=["cam02"]))
    assert told == {(index, 1): "the picture repeats the one before" for index in range(first, FRAMES)}


def test_what_a_codec_draws_anew_is_no_news_of_a_view_that_hangs(clip):
    hung = Corrupt(events=(Event(what="frozen", first=25, views=("cam02",)),)).run(open_recording(clip))
    seen = thumbnails(hung)
    change = seen.change.copy()
    change[40, 1] = change[40, 0]
    seen = replace(seen, change=change)
    said = check_views.faults(seen, check_views.rooms(seen, None), 30.0, ["cam01", "cam02", "cam03"])
    assert np.argwhere(said != "").tolist() == [[row, 1] for row in range(25, FRAMES)]


def test_a_view_that_the_person_leaves_does_not_repeat_itself(clip, tmp_path):
    """A codec shows an empty room as the same picture again and again."""
    folder = tmp_path / "clip"
    shutil.copytree(clip, folder)
    empty = np.clip(rooms()[1] - 4, 0, 255).astype(np.uint8)
    for index in range(40, FRAMES):
        cv2.imwrite(str(folder / f"videos/cam02/{index:06}.png"), empty)
    assert found(folder) == {}


@pytest.mark.parametrize("rate", [7.5, 10.0, 30.0, 120.0])
def test_how_long_a_burst_may_be_does_not_depend_on_the_frame_rate(rate):
    """At 10 frames a second half a second of a kick is five frames."""
    assert check_views.longest(rate) == pytest.approx(0.17 * rate, abs=0.5)
    gesture = np.concatenate([drifting(20, 0, 0), 8 + drifting(0, 0, round(0.5 * rate)), drifting(20, 0, 0)])
    wrong = bursts(gesture, longest=check_views.longest(rate), strong=2, weak=1.3)
    assert not wrong.any()
    assert check_views.longest(2.0) == 1  # one picture may be wrong however few there are


def drifting(still, moving, later):
    """Thumbnails of one view whose brightness stands still, grows, and stands still again."""
    levels = np.cumsum(np.repeat([0.0, 1.0, 0.0], [still, moving, later])) + 50
    return np.broadcast_to(levels[:, None, None, None], (len(levels), 1, 4, 4)).astype(np.float32)


def test_motion_that_starts_and_stops_is_no_burst():
    for moving in (1, 2, 3, 5, 10):
        there = drifting(10, moving, 10)
        assert not bursts(there, longest=5, strong=2, weak=1.3).any()
        back = np.concatenate([there, there[::-1]])
        assert not bursts(back, longest=5, strong=2, weak=1.3).any()
    gesture = np.concatenate([drifting(8, 2, 0), drifting(8, 2, 0)[::-1]])  # there and back, as fast as other motion
    quick = np.concatenate([gesture, drifting(0, 30, 0)])
    assert not bursts(quick, longest=5, strong=2, weak=1.3).any()


def test_a_burst_is_flagged_in_every_view_that_jumps_with_it():
    grey = np.repeat(drifting(0, 30, 0), 3, axis=1)
    grey = grey.copy()
    grey[12:15] += np.array([20, 4, 0], np.float32)[:, None, None]
    wrong = bursts(grey, longest=5, strong=3, weak=1.3)
    assert np.argwhere(wrong).tolist() == [[row, view] for row in (12, 13, 14) for view in (0, 1)]


def walked(*places):
    """Thumbnails of one view that are `places` off a first one, all over."""
    return np.broadcast_to(np.array(places, np.float32)[:, None, None, None], (len(places), 1, 20, 20)).copy()


@pytest.mark.parametrize(
    ("places", "wrong"),
    [
        ((0, 1, 2, 3, 40, 5, 6, 7, 8), [4]),
        ((0, 1, 2, 3, 40, 41, 6, 7, 8), [4, 5]),
        ((0, 1, 2, 3, 40, 41, 42, 7, 8), []),  # longer than a burst may be
        ((0, 1, 2, 3, 40, 80, 81, 82, 83), []),  # it goes on from there: a step that stays
        ((0, 1, 2, 3, 200, 5, 6, 7, 8, 9, 10, 11, 28, 13, 14, 15, 16), [4, 12]),  # however far the other one jumps
        ((0, 1, 2, 3, 40, 5, 45, 85, 125, 126, 127, 128), []),  # it begins to move as fast
        ((0, 1, 40, 3, 4, 5, 6), [2]),
        ((0, 1, 40, 3, 4), [2]),  # the fewest that tell
        ((0, 40, 2, 3, 4, 5, 6), []),  # no step before it tells how fast things move
        ((0, 1, 2, 3, 40, 5, 6), [4]),
        ((0, 1, 2, 3, 4, 40, 6), []),  # nor one after it
        ((0,), []),
    ],
)
def test_what_jumps_away_and_comes_back_is_a_burst(places, wrong):
    assert np.flatnonzero(bursts(walked(*places), 2, 2.0, 1.3)[:, 0]).tolist() == wrong


def test_a_picture_with_a_small_share_of_its_rooms_contrast_shows_nothing():
    room = np.random.default_rng(0).normal(0, 60, (1, 20, 20)).astype(np.float32)
    grey = np.stack([share * room for share in (1.0, 0.15, 0.07)])  # the last still has more than noise has
    np.testing.assert_array_equal(blank(grey, room)[:, 0], [False, False, True])
    np.testing.assert_array_equal(blank(grey / 60, room / 60)[:, 0], [True, True, True])


def test_bad_thumbnails_are_interpolated():
    grey = drifting(0, 6, 0)
    spoiled, good = grey.copy(), np.ones((6, 1), bool)
    spoiled[2:4], good[2:4] = 0, False
    np.testing.assert_allclose(interpolated(spoiled, good), grey, rtol=1e-6)


def test_a_frame_passes_without_its_wrong_views():
    checks = ViewChecks(
        frame=np.array([3, 7], np.int32), camera=np.array([1, 0], np.int16), reasons=("shows nothing", "torn")
    )
    images = (np.zeros((2, 2, 3), np.uint8),) * 2
    frame = Frame(index=7, time=0.1, images=images, usable=np.array([True, False]), reasons=("", "dropped"))
    assert checks.passed(frame).usable.tolist() == [False, False]
    assert checks.passed(frame).reasons == ("torn", "dropped")
    good = replace(frame, index=4)
    assert checks.passed(good) is good


@pytest.mark.long
def test_the_track_goes_without_them_and_says_so(tmp_path, clip):
    spoil = {"use": "corrupt", "events": [{"what": "black", "first": 2, "count": 1, "views": ["cam01"]}]}
    path = write_pipeline(tmp_path, clip, stages={"corrupt": spoil, "checks": "check_views", **STAGES})
    run_tiny(path, tmp_path, frames=4)
    track = the_track(tmp_path)
    assert track.usable[:, 0].tolist() == [True, True, False, True]
    assert track.notes == ("frame 2: cam01 not usable: the picture shows nothing",)
    _, lines = run_tiny(path, tmp_path, frames=6)
    assert "track: going on after 4 frames" in lines  # what is found does not depend on how far the run goes
    assert load(path)
