"""Cameras that are too dark are brightened, frames and plates alike; well exposed ones stay as they are."""

import cv2
import numpy as np
import pytest
from mocapflow_robustness.exposure import Exposure, brightness

from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import Recording, open_recording

DEMO = shipped("examples", "data", "skirt_steps")


@pytest.fixture
def dim(tmp_path) -> Recording:
    """The demo, three frames of it, as if a camera had been stopped down; another begins with a black frame."""
    (tmp_path / "cameras.toml").write_text((DEMO / "cameras.toml").read_text())
    recording = open_recording(DEMO, stop=3)
    (tmp_path / "background").mkdir()
    for frame in recording.frames():
        for number, image in enumerate(frame.images):
            dimmed = dimly(image) if number == 1 else image * (number != 2 or frame.index > 0)
            (tmp_path / "videos" / f"cam0{number + 1}").mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(tmp_path / "videos" / f"cam0{number + 1}" / f"{frame.index}.png"), dimmed)
    for plate in (DEMO / "background").glob("*.png"):
        image = cv2.imread(str(plate))
        cv2.imwrite(str(tmp_path / "background" / plate.name), dimly(image) if plate.stem == "cam02" else image)
    return open_recording(tmp_path)


def dimly(image):
    return np.rint(0.4 * image).astype(np.uint8)


def test_a_dark_camera_is_brightened_and_no_other(dim):
    brightened, true = Exposure().run(dim), open_recording(DEMO)
    gains = [view.gain for view in brightened.views]
    assert [gain for number, gain in enumerate(gains) if number != 1] == [1, 1, 1]
    assert gains[1] == pytest.approx(2.5, rel=0.05)
    seen, expected = brightened.frame(2).images[1], true.frame(2).images[1]
    assert np.median(np.abs(seen.astype(float) - gains[1] * 0.4 * expected)) < 1
    assert brightness(seen) == pytest.approx(Exposure().bright, abs=2)


def test_its_plate_is_brightened_as_well(dim):
    brightened, true = Exposure().run(dim).background(), open_recording(DEMO).background()
    assert brightened is not None and true is not None
    off = np.abs(brightened.mean[1] - true.mean[1])
    assert np.median(off) < 5
    assert np.median(np.abs(dim.background().mean[1] - true.mean[1])) > 50


def test_a_recording_that_is_well_exposed_stays_as_it_is():
    assert [view.gain for view in Exposure().run(open_recording(DEMO)).views] == [1, 1, 1, 1]


def test_gains_are_bounded_and_small_ones_are_left_out():
    assert Exposure(bright=200, least=1.25, most=4).gains(np.array([250, 200, 170, 100, 10, 0])) == [1, 1, 1, 2, 4, 4]
