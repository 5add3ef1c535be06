"""Cameras that are too dark or tinged are set right, frames and plates alike, and so are frames that grow darker."""

import cv2
import numpy as np
import pytest
from mocapflow_robustness.exposure import Exposure, brighter, brightness, thinned

from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import Recording, open_recording

DEMO = shipped("examples", "data", "skirt_steps")
SHADE = np.random.default_rng(0).uniform(60, 180, (50, 40, 1)) * [0.8, 1, 1.1]  # of a room


def times(image, factor):
    return np.clip(np.rint(image * np.asarray(factor, float)), 0, 255).astype(np.uint8)


@pytest.fixture
def filmed(tmp_path):
    """Three frames of the demo as cameras have them whose grey levels are multiplied, in each frame and on plates."""

    def film(factors, plates) -> Recording:
        (tmp_path / "cameras.toml").write_text((DEMO / "cameras.toml").read_text())
        (tmp_path / "background").mkdir()
        for view, (camera, factor) in enumerate(plates.items()):
            (tmp_path / "videos" / camera).mkdir(parents=True)
            plate = cv2.imread(str(DEMO / "background" / f"{camera}.png"))
            cv2.imwrite(str(tmp_path / "background" / f"{camera}.png"), times(plate, factor))
            for frame in open_recording(DEMO, stop=3).frames():
                picture = times(frame.images[view], factors[camera][frame.index])
                cv2.imwrite(str(tmp_path / "videos" / camera / f"{frame.index}.png"), picture)
        return open_recording(tmp_path)

    return film


def off(one, other):
    """Return by how many grey levels pictures differ, mostly."""
    return float(np.median(np.abs(one.astype(float) - other)))


def test_a_dark_camera_is_brightened_with_its_plate_and_no_other(filmed, caplog):
    """One was stopped down; one begins with a black picture."""
    always, once = [1.0] * 3, [0, 1, 1]
    dim = filmed(
        {"cam01": always, "cam02": [0.4] * 3, "cam03": once, "cam04": always},
        {"cam01": 1, "cam02": 0.4, "cam03": 1, "cam04": 1},
    )
    true, brightened = open_recording(DEMO), Exposure().run(dim)
    assert [view.tone is None for view in brightened.views] == [True, False, True, True]
    assert [said.getMessage()[:20] for said in caplog.records] == ["cam02 is too dark or"]
    seen = brightened.frame(2).images[1]
    assert brightness(seen).max() == pytest.approx(Exposure().bright, abs=2)
    assert off(seen, true.frame(2).images[1]) < 5
    assert off(dim.frame(2).images[1], true.frame(2).images[1]) > 50
    assert off(brightened.background().mean[1], true.background().mean[1]) < 5


def test_a_tinged_camera_shows_white_as_white(filmed):
    warm = (0.5, 0.85, 1.1)
    cameras = ("cam01", "cam02", "cam03", "cam04")
    tinged = filmed(dict.fromkeys(cameras, [warm] * 3), dict.fromkeys(cameras, warm))
    for picture in Exposure().run(tinged).frame(0).images:
        np.testing.assert_allclose(brightness(picture), Exposure().bright, atol=3)


def test_an_overexposed_camera_is_told(filmed, caplog):
    always = [1.0] * 3
    filmed_so = filmed(
        {"cam01": always, "cam02": [1.5] * 3, "cam03": always, "cam04": always},
        {"cam01": 1, "cam02": 1.5, "cam03": 1, "cam04": 1},
    )
    assert Exposure().run(filmed_so).views[1].tone is None
    assert [said.getMessage()[:20] for said in caplog.records] == ["cam02 is overexposed"]


def test_frames_that_grow_darker_are_as_bright_as_the_first(filmed):
    """In one of them by cloud, in one by the camera's own will; one shows nothing in the last frame."""
    always, cloud = [1.0] * 3, [1, 0.95, 0.8]
    dim = filmed(
        {"cam01": cloud, "cam02": [1, 1.1, 1.2], "cam03": [1, 1, 0], "cam04": always},
        dict.fromkeys(("cam01", "cam02", "cam03", "cam04"), 1),
    )
    true, steady = open_recording(DEMO).frame(2).images, Exposure().run(dim).frame(2).images
    filmed_so = dim.frame(2).images
    for view in (0, 1):
        assert off(steady[view], true[view]) <= 1
        assert off(filmed_so[view], true[view]) > 20
    assert not steady[2].any()
    np.testing.assert_array_equal(steady[3], filmed_so[3])


def test_a_recording_that_is_well_exposed_stays_as_it_is():
    recording = open_recording(DEMO)
    same = Exposure().run(recording)
    assert all(view.tone is None for view in same.views)
    for before, after in zip(recording.frame(30).images, same.frame(30).images, strict=True):
        np.testing.assert_array_equal(before, after)


def test_how_much_brighter_is_told_by_most_of_a_room_and_not_of_another_room():
    room = times(SHADE, 1)
    dim = times(room, [0.7, 0.8, 0.9])
    dim[10:30, 5:20] = (20, 200, 40)  # somebody
    np.testing.assert_allclose(brighter(dim, room), [0.7, 0.8, 0.9], atol=0.01)
    assert brighter(times(room[::-1], 1), room) is None
    assert brighter(times(room, 0.1), room) is None
    assert brighter(thinned(np.zeros((400, 320, 3), np.uint8)), thinned(np.zeros((400, 320, 3), np.uint8))) is None


@pytest.mark.parametrize(
    ("bright", "gain"),
    [
        ((180, 200, 210), None),  # well set
        ((110, 150, 180), None),  # warm light, as many a room has
        ((60, 80, 100), (2, 2, 2)),
        ((20, 20, 20), (4, 4, 4)),  # no more
        ((80, 150, 200), (2.5, 200 / 150, 1)),  # tinged
    ],
)
def test_gains(bright, gain):
    found = Exposure(bright=200, darker=1.25, most=4).gains(np.array(bright, float))
    assert found is None if gain is None else found == pytest.approx(gain)
