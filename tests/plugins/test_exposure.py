"""Cameras that are too dark or tinged are set right, frames and plates alike, and so are frames that are darker."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from mocapflow_robustness.brightness import NormalisedBrightness, block_means, relative_gain
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.exposure import STEP, Exposure

from mocapflow.errors import PipelineError
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import Recording, open_recording

DEMO = shipped("examples", "data", "skirt_steps")
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
WARM = (0.5, 0.85, 1.1)
SHADE = np.random.default_rng(0).uniform(60, 180, (50, 40, 1)) * [0.8, 1, 1.1]  # blocks of a room
FRAMES = 12


def times(image, factor):
    return np.clip(np.rint(image * np.asarray(factor, float)), 0, 255).astype(np.uint8)


@pytest.fixture
def filmed(tmp_path):
    """The beginning of the demo as cameras have it whose levels are multiplied: in each frame, and on the plate."""

    def film(plates=None, **factors) -> Recording:
        (tmp_path / "cameras.toml").write_text((DEMO / "cameras.toml").read_text())
        (tmp_path / "background").mkdir()
        frames = list(open_recording(DEMO, stop=FRAMES).frames())
        for number, camera in enumerate(CAMERAS):
            (tmp_path / "videos" / camera).mkdir(parents=True)
            plate = cv2.imread(str(DEMO / "background" / f"{camera}.png"))
            cv2.imwrite(str(tmp_path / "background" / f"{camera}.png"), times(plate, (plates or {}).get(camera, 1)))
            for frame, factor in zip(frames, factors.get(camera, [1] * FRAMES), strict=True):
                if factor is not None:  # a frame that is missing
                    picture = times(frame.images[number], factor)
                    cv2.imwrite(str(tmp_path / "videos" / camera / f"{frame.index:02}.png"), picture)
        return open_recording(tmp_path)

    return film


@pytest.fixture
def true():
    return open_recording(DEMO)


def off(one, other):
    """Return by how many grey levels pictures differ, mostly."""
    return float(np.median(np.abs(one.astype(float) - other)))


def test_a_dark_camera_is_brightened_with_its_plate_and_no_other(filmed, true, caplog):
    dim = filmed(plates={"cam02": 0.4}, cam02=[0.4] * FRAMES)
    brightened = Exposure().run(dim)
    assert [view.levels is None for view in brightened.views] == [True, False, True, True]
    assert [said.getMessage()[:20] for said in caplog.records] == ["cam02 is too dark: b"]
    seen = brightened.frame(2).images[1]
    assert off(seen, true.frame(2).images[1]) < 5
    assert off(dim.frame(2).images[1], true.frame(2).images[1]) > 50
    assert off(brightened.background().mean[1], true.background().mean[1]) < 5
    np.testing.assert_array_equal(brightened.seen_by(1).frame(2).images[0], seen)


def test_a_tinged_camera_shows_white_nearly_as_white(filmed, caplog):
    tinged = filmed(plates=dict.fromkeys(CAMERAS, WARM), **dict.fromkeys(CAMERAS, [WARM] * FRAMES))
    for before, after in zip(tinged.frame(0).images, Exposure().run(tinged).frame(0).images, strict=True):
        was, bright = (np.percentile(picture[::STEP, ::STEP], 95, axis=(0, 1)) for picture in (before, after))
        assert was.max() > 3 * was.min()
        assert bright.max() < 1.4 * bright.min()
    assert [said.getMessage()[:15] for said in caplog.records] == [f"{camera} is tinged" for camera in CAMERAS]


def test_an_overexposed_camera_is_told(filmed, caplog):
    assert Exposure().run(filmed(cam02=[1.5] * FRAMES)).views[1].levels is None
    assert [said.getMessage()[:20] for said in caplog.records] == ["cam02 is overexposed"]


def test_frames_that_grow_darker_are_as_bright_as_usual(filmed, true):
    """In one camera by cloud, in one by its own will; one shows nothing in the last frame."""
    usual = [1.0] * (FRAMES - 1)
    changing = filmed(cam01=[*usual, 0.8], cam02=[*usual, 1.2], cam03=[*usual, 0])
    last = FRAMES - 1
    expected, steady, seen = (each.frame(last).images for each in (true, Exposure().run(changing), changing))
    for view in (0, 1):
        assert off(steady[view], expected[view]) <= 1
        assert off(seen[view], expected[view]) > 20
    assert not steady[2].any()
    np.testing.assert_array_equal(steady[3], seen[3])


def test_a_lamp_that_goes_out_at_one_side_leaves_a_frame_as_bright_as_usual(filmed, true):
    width = true.cameras[0].size[0]
    fading = np.linspace(0.55, 1, width)[:, None] * np.ones(3)
    dim = filmed(cam01=[*[1.0] * (FRAMES - 1), fading])
    last = FRAMES - 1
    steady, seen, expected = (each.frame(last).images[0] for each in (Exposure().run(dim), dim, true))
    assert off(steady, expected) <= 1
    assert off(seen, expected) > 15


@pytest.mark.parametrize("odd", [0.6, 20.0, 0.0, None], ids=["dark", "white", "black", "missing"])
def test_an_odd_first_frame_does_not_tell_how_a_camera_is_set(filmed, true, odd):
    """It is brought to the others, or stays; the others stay."""
    recording = filmed(cam01=[odd, *[1] * (FRAMES - 1)])
    corrected = Exposure().run(recording)
    assert corrected.views[0].levels is None
    np.testing.assert_array_equal(corrected.frame(5).images[0], recording.frame(5).images[0])
    if odd == 0.6:
        assert off(corrected.frame(0).images[0], true.frame(0).images[0]) <= 1
    else:
        np.testing.assert_array_equal(corrected.frame(0).images[0], recording.frame(0).images[0])


@pytest.mark.parametrize("lost", [0.0, None], ids=["black", "missing"])
def test_a_camera_that_shows_nothing_for_long_stays_as_it_is(filmed, lost):
    recording = filmed(cam01=[*[lost] * 10, 1, 1])
    corrected = Exposure().run(recording)
    assert corrected.views[0].levels is None
    np.testing.assert_array_equal(corrected.frame(11).images[0], recording.frame(11).images[0])


def test_a_recording_that_is_well_exposed_stays_as_it_is(true):
    same = Exposure().run(true)
    assert all(view.levels is None for view in same.views)
    for before, after in zip(true.frame(30).images, same.frame(30).images, strict=True):
        np.testing.assert_array_equal(before, after)


def test_the_first_frames_of_the_videos_tell_wherever_a_run_begins(filmed):
    dim = filmed(cam01=[0.4] * FRAMES)
    late = replace(dim, indices=dim.indices[10:])
    one, other = (Exposure().run(recording).views[0].levels for recording in (dim, late))
    np.testing.assert_array_equal(one, other)


def test_it_stands_before_what_changes_pictures(true):
    with pytest.raises(PipelineError, match="changed already"):
        Exposure().run(Corrupt(noise=0.5).run(true))


@pytest.mark.parametrize("noise", [0, 8])
def test_how_much_brighter_is_told_by_most_of_a_room(noise):
    """Somebody stands in it, and pixels are noisy."""
    dim = SHADE * [0.7, 0.8, 0.9]
    dim[10:30, 5:20] = (20, 200, 40)
    rng = np.random.default_rng(1)
    room, dim = (each.repeat(8, axis=0).repeat(8, axis=1) for each in (SHADE, dim))
    noisy = (times(each + rng.normal(0, noise, each.shape), 1) for each in (dim, room))
    np.testing.assert_allclose(relative_gain(*map(block_means, noisy)), [0.7, 0.8, 0.9], atol=0.01)


def test_how_much_brighter_is_told_where_light_changes_across_a_room():
    y, x = np.meshgrid(np.linspace(-1, 1, 50), np.linspace(-1, 1, 40), indexing="ij")
    light = np.exp(-0.3 + 0.25 * x - 0.1 * x * y + 0.1 * y**2)[..., None] * [1, 0.95, 0.9]
    dim = SHADE * light
    dim[10:35, 5:15] = (20, 200, 40)  # somebody
    found = relative_gain(times(dim, 1), times(SHADE, 1))
    assert found.shape == light.shape
    np.testing.assert_allclose(found, light, rtol=0.02)


def test_light_that_changes_across_a_room_is_not_guessed_to_change_more_where_it_is_too_dark_to_tell():
    light = np.exp(0.4 * np.linspace(-1, 1, 40))[None, :, None] * np.ones((50, 1, 3))
    room, dark = SHADE.copy(), slice(None, 12)
    room[:, dark] = 10
    found = relative_gain(times(room * light, 1), times(room, 1))
    np.testing.assert_allclose(found[:, 12:], light[:, 12:], rtol=0.02)
    assert found[:, dark].min() >= light[:, 12:].min() * 0.98


def test_how_much_brighter_nobody_can_tell_of_another_room_or_a_black_one():
    room = times(SHADE, 1)
    assert relative_gain(room[::-1], room) is None
    assert relative_gain(times(room, 0.1), room) is None
    assert relative_gain(room * np.uint8(0), room * np.uint8(0)) is None


def test_blocks_that_are_too_bright_to_tell_say_nothing_and_a_few_are_too_few():
    light, white, few = SHADE.copy(), slice(None, 30), slice(None, 2)
    light[white] = 400  # more than a camera shows
    np.testing.assert_allclose(relative_gain(times(light, 0.5), times(light, 1)), 0.5, atol=0.02)
    dark = np.full(SHADE.shape, 10.0)
    dark[few] = SHADE[few]
    assert relative_gain(times(dark, 0.8), times(dark, 1)) is None


@pytest.mark.parametrize(("factor", "stays"), [(0.985, True), (0.95, False)])
def test_a_frame_that_is_nearly_as_bright_stays_as_it_is(factor, stays):
    room = times(SHADE.repeat(8, axis=0).repeat(8, axis=1), 1)
    dimmer = times(room, factor)
    shown = NormalisedBrightness(0.02, {}).image(dimmer, block_means(room))
    assert (shown is dimmer) == stays
    assert block_means(room[:, :20]).shape == (400, 20, 3)  # of so narrow a picture each pixel is a block


@pytest.mark.parametrize(
    ("bright", "brightest", "gains"),
    [
        ((180, 200, 210), (220, 230, 240), None),  # well set
        ((110, 150, 180), (150, 190, 220), None),  # warm light, as many a room has
        ((60, 80, 100), (70, 90, 120), (2, 2, 2)),
        ((20, 20, 20), (30, 30, 30), (4, 4, 4)),  # no more
        ((20, 20, 20), (60, 150, 170), (1.5, 1.5, 1.5)),  # no more: somebody who is lit in a dark room
        ((20, 20, 20), (100, 200, 250), None),  # well lit
        ((80, 150, 200), (100, 160, 210), (2.5, 200 / 150, 1)),  # tinged
        ((60, 180, 60), (230, 250, 240), None),  # a green room, in which somebody wears all colours
    ],
)
def test_gains(bright, brightest, gains):
    found = Exposure(bright=200, least_gain=1.25, most_gain=4).gains(
        np.array(bright, float), np.array(brightest, float)
    )
    assert found is None if gains is None else found == pytest.approx(gains)
