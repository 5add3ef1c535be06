"""Cameras that are knocked while they film."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mocapflow_robustness import knock_detection
from mocapflow_robustness.check_views import CheckViews
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.events import Event

from mocapflow.geometry.camera_rotation import shift_px
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.recordings.recording import open_recording
from mocapflow.testing import scenes

DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


@pytest.fixture(scope="module")
def demo():
    return open_recording(DEMO)


def shaken(demo, *turns, black=None):
    """Return the demo with cam02 turned by (first frame, degrees), ascending, and some frames black."""
    events = [Event(what="knocked", first=first, views=("cam02",), turn_deg=degrees) for first, degrees in turns]
    events += [] if black is None else [Event(what="black", first=black, count=2)]
    return Corrupt(events=tuple(events)).run(demo)


def found(demo, *turns, black=None):
    """Return (frame, camera, px off what is true) of each knock."""
    knocks = CheckViews().run(shaken(demo, *turns, black=black), demo.background()).knocks
    if knocks is None:
        return []
    told = []
    for frame, number, turn in zip(knocks.frame.tolist(), knocks.camera.tolist(), knocks.turn, strict=True):
        degrees = [degrees for first, degrees in turns if first <= frame][-1]
        true = Event(what="knocked", turn_deg=degrees).homography(demo.cameras[number])
        told.append((frame, number, shift_px(turn @ np.linalg.inv(true), demo.cameras[number])))
    return told


def test_what_a_camera_sees_moves_to_the_left_as_it_turns_to_the_right(demo):
    camera = demo.cameras[1]
    (f, _, x), (_, _, y) = camera.intrinsics[:2]
    column, row, depth = Event(what="knocked", turn_deg=2.0).homography(camera) @ [x, y, 1]
    assert (column / depth, row / depth) == pytest.approx((x - f * np.tan(np.radians(2)), y))


def test_nobody_knocked_a_camera(demo, caplog):
    assert found(demo) == []
    assert caplog.messages == []


@pytest.mark.parametrize(("first", "degrees"), [(1, 0.15), (20, -1.2), (58, 0.15)])
@pytest.mark.long
def test_the_frame_and_the_turn_are_found(demo, caplog, first, degrees):
    ((frame, camera, off),) = found(demo, (first, degrees))
    assert (frame, camera) == (first, 1)
    assert off < 0.3
    (message,) = caplog.messages
    assert message.startswith(f"cam02 was knocked in frame {first}: its pictures are ")


@pytest.mark.long
def test_a_camera_that_swings_and_is_put_back(demo, monkeypatch):
    monkeypatch.setattr(knock_detection, "EVERY_S", 0.5)
    told = found(demo, (20, 1.2), (22, 0.6), (23, -0.3), (40, 0.0))
    assert [(frame, camera) for frame, camera, _ in told] == [(20, 1), (22, 1), (23, 1), (40, 1)]
    assert max(off for *_, off in told) < 0.3


@pytest.mark.long
def test_black_pictures_do_not_tell(demo):
    told = found(demo, (20, 0.8), black=19)
    assert [(frame, camera) for frame, camera, _ in told] == [(21, 1)]  # the first one that can tell


def test_the_track_is_passed_what_the_camera_would_have_seen(demo):
    source = shaken(demo, (20, 0.8))
    checks = CheckViews().run(source, demo.background())
    true, seen = demo.frame(30), checks.passed(source.frame(30))
    known = ~seen.hidden[1]
    assert known.mean() > 0.9
    off = np.abs(seen.images[1].astype(int) - true.images[1])[known]
    assert np.mean(off) < 2.0  # grey levels: resampled twice
    assert np.abs(source.frame(30).images[1].astype(int) - true.images[1]).mean() > 5


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """A camera in a room full of corners, of which there is no clean plate."""
    folder = tmp_path_factory.mktemp("bare")
    (camera,) = scenes.tiny_scene(cameras=1).cameras
    write_cameras(folder / "cameras.toml", [camera])
    (folder / "videos" / camera.name).mkdir(parents=True)
    blocks = np.random.default_rng(0).integers(40, 220, (*camera.size[::-1] // 10, 3), np.uint8)
    for index in range(6):
        cv2.imwrite(str(folder / f"videos/{camera.name}/{index:06}.png"), blocks.repeat(10, axis=0).repeat(10, axis=1))
    return open_recording(folder)


@pytest.mark.parametrize("black", [0, 2], ids=["none", "two"])
def test_without_a_clean_plate_the_first_picture_that_shows_anything_is_the_room(bare, black):
    events = [Event(what="knocked", first=4, turn_deg=1.0), *([Event(what="black", count=black)] if black else [])]
    knocks = CheckViews().run(Corrupt(events=tuple(events)).run(bare)).knocks
    assert knocks.frame.tolist() == [4]
