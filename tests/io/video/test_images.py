"""Images as they are read from files, whole and damaged, and numbered by frame."""

import cv2
import numpy as np
import pytest

from mocapflow.io.video.images import name_frames, numbered, read_image

PICTURE = np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8)


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tif"])
def test_an_image_that_is_cut_off_is_none(tmp_path, ending):
    file = tmp_path / f"caméra 1{ending}"
    data = cv2.imencode(ending, PICTURE)[1].tobytes()
    file.write_bytes(data)
    whole = read_image(file)
    assert np.array_equal(whole, cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
    for length in (0, len(data) // 4, len(data) // 2, len(data) - 30):
        file.write_bytes(data[:length])
        assert read_image(file) is None


def test_a_jpeg_may_hold_a_thumbnail_and_go_on_behind_its_end(tmp_path):
    data, small = (cv2.imencode(".jpg", image)[1].tobytes() for image in (PICTURE, PICTURE[::4, ::4]))
    exif = b"Exif\0\0" + small
    with_thumbnail = data[:2] + b"\xff\xe1" + (2 + len(exif)).to_bytes(2, "big") + exif + data[2:]
    file = tmp_path / "0.jpg"
    file.write_bytes(with_thumbnail + b"maker's notes")
    assert read_image(file) is not None
    file.write_bytes(with_thumbnail[:-100])
    assert read_image(file) is None


def test_no_image_is_none(tmp_path):
    assert read_image(tmp_path / "0.png") is None


def test_hidden_files_are_no_images(tmp_path):
    cv2.imwrite(str(tmp_path / "000001.png"), PICTURE)
    (tmp_path / "._000001.png").write_bytes(b"what another system keeps beside the file")
    assert numbered(tmp_path, (".png",)) == {1: tmp_path / "000001.png"}


def test_naming_frames():
    assert name_frames([3]) == "frame 3"
    assert name_frames(list(range(2, 9))) == "frames 2, 3, 4, 5, 6 and 2 more"
