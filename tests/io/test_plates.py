"""Clean plates: mean and spread of the empty scene."""

import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.recording import open_recording
from tests.fixtures.recordings import NAMES, SIZE, write_recording


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


def test_several_plates_give_the_spread_of_each_pixel(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        for take in range(20):
            plate(tmp_path / "background" / name / f"{take}.png", noise=5.0, seed=take)
    scene = open_recording(tmp_path).background()
    assert np.median(scene.spread[1]) == pytest.approx(5, rel=0.1)
    assert scene.spread[1].min() >= 0.9 * 5  # no pixel is trusted more than the usual one


def test_plates_are_scaled_with_the_frames(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES:
        plate(tmp_path / "background" / f"{name}.png")
    assert open_recording(tmp_path, scale=0.5).background().mean[0].shape == (24, 32, 3)


def test_bad_plates(tmp_path):
    write_recording(tmp_path, frames=2)
    for name in NAMES[:2]:
        plate(tmp_path / "background" / f"{name}.png")
    with pytest.raises(RecordingError, match="background  no clean plate of cam03\n       give every camera its plate"):
        open_recording(tmp_path).background()
    plate(tmp_path / "background" / "cam03.png", size=(32, 24))
    with pytest.raises(RecordingError, match=r"cam03\.png  this clean plate is 32 x 24 px, the video 64 x 48"):
        open_recording(tmp_path).background()
    (tmp_path / "background" / "cam03.png").write_text("no image")
    with pytest.raises(RecordingError, match=r"cam03\.png  this clean plate can't be read"):
        open_recording(tmp_path).background()
