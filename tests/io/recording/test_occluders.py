"""What stands between a camera and the person, as whoever has filmed has painted it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import bends
from mocapflow.io.cameras.views import View
from mocapflow.recordings.doctor import examine
from mocapflow.recordings.recording import open_recording
from tests.fixtures.recordings import NAMES, SIZE, ring, write_recording

LEFT = np.arange(SIZE[0]) < SIZE[0] // 2


def paint(folder, camera, white=LEFT, size=SIZE):
    """Paint the columns of a picture white that are said; return where it lies."""
    path = folder / "occluders" / f"{camera}.png"
    path.parent.mkdir(exist_ok=True)
    picture = np.zeros((size[1], size[0]), np.uint8)
    picture[:, : len(white)][:, white[: size[0]]] = 255
    cv2.imwrite(str(path), picture)
    return path


def test_nothing_is_hidden_where_nobody_has_painted(tmp_path):
    recording = open_recording(write_recording(tmp_path, frames=2))
    assert recording.frame(0).hidden == ()


def test_what_is_painted_white_is_hidden_in_every_frame(tmp_path):
    write_recording(tmp_path, frames=3)
    paint(tmp_path, "cam02")
    recording = open_recording(tmp_path)
    assert "occluders/cam02.png" in recording.content
    for frame in recording.frames():
        assert [mask.any() for mask in frame.hidden] == [False, True, False]
        np.testing.assert_array_equal(frame.hidden_in(1), np.broadcast_to(LEFT, frame.images[1].shape[:2]))
    assert recording.seen_by(0).frame(0).hidden == ()
    assert recording.seen_by(1).frame(0).hidden_in(0).any()


def test_smaller_images_hide_each_pixel_that_shows_some_of_it(tmp_path):
    write_recording(tmp_path, frames=1)
    paint(tmp_path, "cam01", np.arange(SIZE[0]) < 9)
    hidden = open_recording(tmp_path, scale=0.5).frame(0).hidden_in(0)
    assert hidden[:, :5].all()
    assert not hidden[:, 5:].any()


def test_it_is_undistorted_as_pictures_are():
    lens = replace(ring()[0], distortion=np.array([-0.3, 0.1, 0, 0, 0]))
    assert bends(lens)
    inner = np.zeros(SIZE[::-1], bool)
    inner[10:-10, 14:-14] = True
    picture = np.where(inner[..., None], 255, np.zeros(3)).astype(np.uint8)
    view = View(lens=lens, occluder=inner, levels=np.zeros((256, 3), np.uint8))
    np.testing.assert_array_equal(view.hidden, View(lens=lens).image(picture)[..., 0] > 0)
    assert (view.hidden != inner).any()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path: path.write_bytes(b"no picture"), "can't be read"),
        (lambda path: cv2.imwrite(str(path), np.zeros((20, 30), np.uint8)), "is 30 x 20 px, the video 64 x 48"),
        (lambda path: cv2.imwrite(str(path), np.full(SIZE[::-1], 255, np.uint8)), "100% of this picture of occluders"),
        (lambda path: path.with_suffix(".jpg").write_bytes(path.read_bytes()), "2 pictures of occluders of cam01"),
    ],
    ids=["broken", "another size", "all white", "two"],
)
def test_a_picture_that_tells_nothing_is_refused_by_runs_and_by_the_doctor(spoil, said, tmp_path):
    write_recording(tmp_path, frames=2)
    spoil(paint(tmp_path, "cam01"))
    with pytest.raises(RecordingError, match=said):
        open_recording(tmp_path)
    assert any(said in finding.message and finding.severity == "error" for finding in examine(tmp_path))


def test_the_doctor_says_how_much_is_painted(tmp_path):
    write_recording(tmp_path, frames=2)
    paint(tmp_path, "cam02")
    said = [finding.message for finding in examine(tmp_path) if "occluders" in finding.message]
    assert said == ["cam02: 50% of its pictures are behind occluders"]


def test_a_picture_of_no_camera_is_told(tmp_path):
    write_recording(tmp_path, frames=2)
    paint(tmp_path, "left")
    assert open_recording(tmp_path).warnings == (
        f"not used from occluders/: left.png; pictures are named after their cameras: {NAMES[0]}.png",
    )
