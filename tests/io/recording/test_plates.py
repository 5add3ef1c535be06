"""Clean plates: mean and spread of the empty scene."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from mocapflow_sequence.background import EmptyScene
from scipy.spatial.transform import Rotation

from mocapflow.errors import RecordingError
from mocapflow.geometry.camera_rotation import homography, shift_px, warped
from mocapflow.io.recording.plates import _laid_over, toned
from mocapflow.recordings.first_look import examine_first_frame
from mocapflow.recordings.recording import open_recording
from mocapflow.records import record
from mocapflow.registry import load_registry
from mocapflow.testing import scenes
from tests.fixtures.recordings import NAMES, SIZE, write_recording

DEMO = Path(__file__).parents[3] / "examples" / "data" / "skirt_steps"


def plate(path, level=30, size=SIZE, noise=0.0, seed=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    grey = np.random.default_rng(seed).normal(level, noise, (size[1], size[0], 3))
    cv2.imwrite(str(path), np.clip(np.round(grey), 0, 255).astype(np.uint8))


def test_no_plates_no_background(tmp_path):
    assert open_recording(write_recording(tmp_path, frames=2)).background() is None


def test_one_plate_takes_its_spread_from_the_first_frame(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.png", noise=8.0)
    scene = open_recording(tmp_path).background()
    assert [m.shape for m in scene.mean] == [(48, 64, 3)] * 3
    assert scene.mean[0].mean() == pytest.approx(30, abs=0.5)
    assert scene.spread[0][0, 0] == pytest.approx([8, 8, 8], rel=0.15)
    assert np.ptp(scene.spread[0], axis=(0, 1)).max() == 0


def test_the_ending_of_a_plate_may_be_in_capitals(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.PNG")
    recording = open_recording(tmp_path)
    assert recording.warnings == ()
    assert recording.background() is not None
    assert "background/cam02.PNG" in recording.content


def test_what_is_no_plate_of_any_camera_is_said(tmp_path):
    write_recording(tmp_path, frames=2)
    plate(tmp_path / "background" / "empty.png")
    (tmp_path / "background" / "cam01.heic").write_bytes(b"")
    recording = open_recording(tmp_path)
    assert recording.background() is None
    assert recording.warnings == (
        "not used from background/: cam01.heic, empty.png; pictures are named after their cameras: cam01.png",
    )


def test_several_plates_give_the_spread_of_each_pixel(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        for take in range(20):
            plate(tmp_path / "background" / name / f"{take}.png", noise=5.0, seed=take)
    scene = open_recording(tmp_path).background()
    assert np.median(scene.spread[1]) == pytest.approx(5, rel=0.1)
    assert scene.spread[1].min() >= 0.9 * 5  # no pixel is trusted more than the usual one


@pytest.mark.parametrize(("levels", "spread"), [((30, 30), 1.0), ((28, 32), 8**0.5)])
def test_two_plates_tell_the_spread_but_none_below_a_grey_level(tmp_path, levels, spread):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        for take, level in enumerate(levels):
            plate(tmp_path / "background" / name / f"{take}.png", level)
    for found in open_recording(tmp_path).background().spread:
        np.testing.assert_allclose(found, spread, rtol=1e-5)


def room(noise=0.0, seed=0):
    """A room of 60 x 80 px, dark to the left and light to the right."""
    grey = np.linspace(40, 200, 80)[None, :, None] + np.array([-10.0, 0.0, 20.0])
    return (grey + np.random.default_rng(seed).normal(0, noise, (60, 80, 3))).astype(np.float32)


EVERYWHERE = np.ones((60, 80), bool)


def test_a_plate_takes_the_tone_of_a_frame_whoever_stands_before_it():
    frame = 0.95 * room(1.0, seed=1) - np.array([4.0, 5.0, 6.0], np.float32)
    frame[10:55, 30:45] = 90.0  # a person
    found = toned(room(1.0, seed=2), frame, EVERYWHERE)
    expected = 0.95 * room() - np.array([4.0, 5.0, 6.0], np.float32)
    assert np.abs(np.median(found - expected, axis=(0, 1))).max() < 0.2
    assert np.abs(np.mean((found - expected)[:, :10], axis=(0, 1))).max() < 0.6  # the dark end too
    assert np.abs(np.mean((found - expected)[:, -10:], axis=(0, 1))).max() < 0.6


def test_an_even_room_may_be_darker_too():
    flat = np.full((60, 80, 3), 120, np.float32)
    np.testing.assert_allclose(toned(flat, flat - 7, EVERYWHERE), flat - 7)


@pytest.mark.parametrize("other", [room()[:, ::-1], np.zeros((60, 80, 3), np.float32), 0.4 * room()])
def test_another_picture_leaves_the_plate_as_it_is(other):
    np.testing.assert_array_equal(toned(room(), other, EVERYWHERE), room())


def test_what_hides_the_room_does_not_tell_its_tone():
    frame = room(1.0, seed=1) - 5
    frame[:, 15:] = 0  # more than is seen
    shown = EVERYWHERE.copy()
    shown[:, 15:] = False
    assert np.abs(np.mean(toned(room(), frame, shown)[:, :15] - room()[:, :15] + 5, axis=(0, 1))).max() < 0.6
    assert np.abs(np.mean(toned(room(), frame, EVERYWHERE)[:, :15] - room()[:, :15] + 5, axis=(0, 1))).max() > 4


@record
class Noisier:
    """Frames with noise, of which a band is hidden."""

    rows: int = 30

    def frames(self, source):
        for frame in source.frames():
            noise = np.random.default_rng(0).normal(0, 10, frame.images[0].shape)
            hidden = np.zeros(frame.images[0].shape[:2], bool)
            hidden[: self.rows] = True
            noisy = np.where(hidden[..., None], 255, np.clip(frame.images[0] + noise, 0, 255)).astype(np.uint8)
            yield replace(frame, images=(noisy,) * len(frame.images), hidden=(hidden,) * len(frame.images))


def test_plates_are_compared_with_the_frame_as_later_stages_see_it(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.png")
    scene = replace(open_recording(tmp_path), changes=(Noisier(),)).background()
    assert scene.spread[0][0, 0] == pytest.approx([10, 10, 10], rel=0.15)
    assert scene.mean[0].mean() == pytest.approx(27, abs=1)  # as the video is; the band would make it 170
    blind = replace(open_recording(tmp_path), changes=(Noisier(rows=48),)).background()
    assert (blind.mean[0] == 30).all()  # as the plate is
    assert blind.spread[0][0, 0] == pytest.approx([4, 4, 4])


@record
class BlankAtFirst:
    """A first frame of one grey, as many a camera begins."""

    level: int = 0

    def frames(self, source):
        for frame in source.frames():
            yield replace(frame, images=tuple(np.full_like(image, self.level) for image in frame.images))


@pytest.mark.parametrize("level", [0, 128])
def test_a_blank_first_frame_tells_nothing(tmp_path, level):
    write_recording(tmp_path, frames=2)
    colours = np.full((48, 64, 3), (30, 60, 90), np.uint8)
    colours[:, 32:] = 200
    (tmp_path / "background").mkdir()
    for name in NAMES:
        cv2.imwrite(str(tmp_path / "background" / f"{name}.png"), colours)
    scene = replace(open_recording(tmp_path), changes=(BlankAtFirst(level=level),)).background()
    assert (scene.mean[0] == colours).all()
    assert scene.spread[0][0, 0] == pytest.approx([4, 4, 4])


def test_plates_are_scaled_with_the_frames(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.png")
    assert open_recording(tmp_path, scale=0.5).background().mean[0].shape == (24, 32, 3)


def test_a_plate_in_colour_beside_a_grey_video(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.png", noise=12.0)  # of a grey room, however noisy
    assert open_recording(tmp_path).background() is not None
    room = np.full((48, 64, 3), (30, 60, 90), np.uint8)
    cv2.imwrite(str(tmp_path / "background" / "cam02.png"), room)
    with pytest.raises(RecordingError, match=r"cam02\.png  this clean plate is in colour, the video is grey\n"):
        open_recording(tmp_path).background()


def test_bad_plates(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES[:2]:
        plate(tmp_path / "background" / f"{name}.png")
    with pytest.raises(RecordingError, match="background  no clean plate of cam03\n       give every camera its plate"):
        open_recording(tmp_path).background()
    plate(tmp_path / "background" / "cam02.jpg")
    with pytest.raises(RecordingError, match=r"background  2 clean plates of cam02: cam02\.jpg, cam02\.png\n"):
        open_recording(tmp_path)
    (tmp_path / "background" / "cam02.jpg").unlink()
    plate(tmp_path / "background" / "cam03.png", size=(32, 24))
    with pytest.raises(RecordingError, match=r"cam03\.png  this clean plate is 32 x 24 px, the video 64 x 48"):
        open_recording(tmp_path).background()
    cv2.imwrite(str(tmp_path / "background" / "cam03.png"), np.full((48, 64), 4000, np.uint16))
    with pytest.raises(RecordingError, match=r"cam03\.png  a picture of 16 bits a pixel that reaches 4000 of 65535"):
        open_recording(tmp_path).background()
    (tmp_path / "background" / "cam03.png").write_text("no image")
    with pytest.raises(RecordingError, match=r"cam03\.png  this clean plate can't be read"):
        open_recording(tmp_path).background()


@pytest.fixture
def nudged(tmp_path):
    """The demo, the plate of cam02 taken before the camera was nudged, and how far (px) that moved it."""
    folder = Path(shutil.copytree(DEMO, tmp_path / "recording"))
    camera, file = open_recording(folder).cameras[1], folder / "background" / "cam02.png"
    turn = homography(Rotation.from_euler("xyz", (0.3, 0.2, 0.5), degrees=True).as_matrix(), camera)
    moved, _ = warped(cv2.imread(str(file)), turn)
    cv2.imwrite(str(file), moved)
    return folder, shift_px(np.linalg.inv(turn), camera)


def test_a_plate_is_laid_over_the_first_frame(nudged):
    folder, shift = nudged
    good, room = open_recording(DEMO).background(), open_recording(folder).background()
    assert good.turned_px == (0, 0, 0, 0)
    assert room.turned_px == pytest.approx((0, shift, 0, 0), abs=0.3)
    for number in (0, 2, 3):
        np.testing.assert_array_equal(room.mean[number], good.mean[number])
    known = room.known[1]
    assert 0.95 < known.mean() < 0.995
    assert np.percentile(np.abs(room.mean[1] - good.mean[1])[known], 95) < 3.0  # grey levels; 20 if it stays
    assert room.spread[1][known].max() < 1.3 * good.spread[1].max()


def test_two_plates_tell_the_same_turn_beside_a_hidden_corner(nudged):
    folder, shift = nudged
    recording, plates = open_recording(DEMO), np.stack([cv2.imread(str(folder / "background" / "cam02.png"))] * 2)
    shown = np.ones(plates.shape[1:3], bool)
    shown[:40, :40] = False
    frame = next(iter(recording.frames())).images[1].astype(np.float32)
    moved, _, turned_px = _laid_over(plates.astype(np.float32), frame, shown, recording.cameras[1])
    assert turned_px == pytest.approx(shift, abs=0.3)
    assert moved.shape == plates.shape


def test_a_run_says_so(nudged, caplog):
    EmptyScene().run(open_recording(nudged[0]), scenes.tiny_scene())
    assert [message.partition(" px")[0][:-4] for message in caplog.messages] == ["cam02 has moved by"]


def test_the_doctor_says_so(nudged):
    found = list(examine_first_frame(nudged[0], load_registry()))
    assert [finding.message.partition(" px")[0][:-4] for finding in found] == ["cam02 has moved by"]
