"""What differs from the empty room; how it tells of cameras that are late is tested with their synchrony."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from mocapflow.geometry.epipolar import pencil_axes
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.recordings.paired_views import _keypoints, _outline, _rooms, _touching, foreground
from mocapflow.recordings.recording import open_recording
from tests.fixtures.recordings import look_at, ring


@pytest.mark.parametrize("change", [[26, 0, 0], [0, -26, 0], [0, 0, 26]])
def test_who_differs_in_one_colour_alone_is_seen(change):
    room = np.full((40, 60, 3), 100, np.float32)
    image = room.astype(np.uint8)
    image[10:30, 20:40] = 100 + np.array(change)
    image[5, 50] = 255  # noise of a pixel
    seen = foreground(image, room)
    assert seen[12:28, 22:38].all() and not seen[:9].any() and not seen[31:].any() and not seen[:, 41:].any()
    image[10:30, 20:40] = 100 + np.sign(change) * 25  # no more than may be noise
    assert not foreground(image, room).any()


FRONT, ABOVE, BESIDE = (look_at("a", np.array(place)) for place in ([4, 0, 1.5], [1, 0, 5.0], [0, 4, 1.5]))


@pytest.mark.parametrize(
    ("other", "box", "known"),
    [
        (ABOVE, (20, 10, 40, 30), 2),
        (ABOVE, (0, 10, 40, 30), 1),
        (ABOVE, (20, 10, 63, 30), 1),
        (BESIDE, (20, 10, 40, 30), 2),
        (BESIDE, (20, 0, 40, 30), 1),
        (BESIDE, (20, 10, 40, 47), 1),
    ],
)
def test_an_outline_that_the_picture_cuts_does_not_tell_where_the_person_ends(other, box, known):
    left, top, right, bottom = box
    outline = np.array([[left, top], [left, bottom], [right, top], [right, bottom]], float)
    (angles,) = _touching([outline], FRONT, pencil_axes(FRONT, other))
    assert np.isfinite(angles).sum() == known


def test_the_outline_is_that_of_the_largest_part_that_differs():
    room = np.zeros((60, 100, 3), np.float32)
    image = room.astype(np.uint8)
    assert _outline(image, room).shape == (0, 2)
    image[5:9, 10:90] = image[30:50, 40:65] = 200  # a long shadow, and somebody
    low, high = _outline(image, room).min(axis=0), _outline(image, room).max(axis=0)
    np.testing.assert_allclose([low, high], [[40, 30], [64, 49]], atol=2)


def test_the_room_without_plates_is_the_median_of_the_pictures_that_can_be_used(tmp_path):
    write_cameras(tmp_path / "cameras.toml", ring())
    for camera in ring():
        place = tmp_path / "videos" / camera.name
        place.mkdir(parents=True)
        for number, grey in enumerate((100, 20, 200)):
            cv2.imwrite(str(place / f"{number}.png"), np.full((48, 64, 3), grey, np.uint8))
    (tmp_path / "videos" / "cam02" / "1.png").write_bytes(b"no picture")
    assert [set(room.ravel().tolist()) for room in _rooms(open_recording(tmp_path))] == [{100}, {150}, {100}]


def test_keypoints_are_those_of_who_is_seen_best_where_confident():
    nobody = np.empty((0, 0, 3))
    two = np.array([[[1, 2, 0.4], [3, 4, 0.4]], [[5, 6, 0.9], [7, 8, 0.2]]])
    seen = [(nobody, nobody), (nobody, two), (nobody, two[:, :1])]  # at last of another estimator
    found = _keypoints(SimpleNamespace(people=seen.__getitem__, indices=range(3)), 1)
    np.testing.assert_array_equal(found[1], [[5, 6], [np.nan, np.nan]])
    assert found.shape == (3, 2, 2) and np.isnan(found[[0, 2]]).all()
