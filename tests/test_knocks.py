"""Frames as if cameras had not been knocked."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocapflow.data import Frame
from mocapflow.geometry.camera_rotation import warped
from mocapflow.knocks import Knocks
from mocapflow.results import ViewChecks

MATRIX = np.array([[90.0, 0, 40], [0, 90, 30], [0, 0, 1]])


def turn(degrees):
    return MATRIX @ Rotation.from_euler("y", degrees, degrees=True).as_matrix() @ np.linalg.inv(MATRIX)


def room():
    row, column = np.mgrid[:60, :80]
    return np.stack([2 * column, 3 * row, column + row], axis=-1).astype(np.uint8)


def seen(index, degrees, **more):
    images = (room(), warped(room(), turn(degrees))[0])
    return Frame(index=index, time=0.0, images=images, usable=np.ones(2, bool), **more)


@pytest.fixture(scope="module")
def knocks():
    """Camera 1 is knocked in frame 5 and again in frame 9."""
    return Knocks(frame=np.array([5, 9], np.int32), camera=np.ones(2, np.int16), turn=np.stack([turn(2.0), turn(-3.0)]))


def test_frames_before_stay(knocks):
    frame = seen(4, 0.0)
    assert knocks.undone(frame) is frame


@pytest.mark.parametrize(("index", "degrees"), [(5, 2.0), (8, 2.0), (9, -3.0), (100, -3.0)])
def test_later_ones_show_what_the_camera_saw_before(knocks, index, degrees):
    frame = seen(index, degrees)
    found = knocks.undone(frame)
    assert found.images[0] is frame.images[0]
    assert not found.hidden[0].any()
    known = ~found.hidden[1]
    assert 0.9 < known.mean() < 0.97  # 90 tan 3° = 5 of 80 columns have left the picture
    off = np.abs(found.images[1].astype(int) - room())[known]
    assert np.percentile(off, 99) <= 2
    assert np.abs(frame.images[1].astype(int) - room()).mean() > 2  # it did show something else


def test_what_was_hidden_stays_hidden_and_is_where_it_is_now(knocks):
    hidden = np.zeros((2, 60, 80), bool)
    hidden[:, 20:30, 40:50] = True
    found = knocks.undone(seen(5, 2.0, hidden=tuple(hidden)))
    np.testing.assert_array_equal(found.hidden[0], hidden[0])
    assert found.hidden[1][hidden[1]].all()
    moved = round(90 * np.tan(np.radians(2)))
    row, column = np.nonzero(found.hidden[1][15:35, 20:60])
    assert (row.mean() + 15, column.mean() + 20) == pytest.approx((24.5, 44.5 - moved / 2), abs=0.6)
    assert np.ptp(column) == pytest.approx(9 + moved, abs=1)


def test_keypoints_move_along(knocks):
    person = np.array([[[40.0, 30.0, 0.9], [70.0, 10.0, 0.4]]])
    found = knocks.undone(seen(6, 2.0, keypoints=(person, person)))
    np.testing.assert_array_equal(found.keypoints[0], person)
    assert found.keypoints[1][0, 0] == pytest.approx([40 - 90 * np.tan(np.radians(2)), 30, 0.9])
    pixel = np.linalg.inv(turn(2.0)) @ [70, 10, 1]
    assert found.keypoints[1][0, 1] == pytest.approx([*(pixel[:2] / pixel[2]), 0.4])


def test_keypoints_of_wrong_views_are_none():
    person = np.array([[[40.0, 30.0, 0.9]]])
    checks = ViewChecks(frame=np.array([6], np.int32), camera=np.zeros(1, np.int16), reasons=("black",))
    assert [len(points) for points in checks.people(6, (person, person))] == [0, 1]
    assert [len(points) for points in checks.people(7, (person, person))] == [1, 1]


def test_checks_pass_frames_on_as_they_were(knocks):
    nothing = {"frame": np.empty(0, np.int32), "camera": np.empty(0, np.int16), "reasons": ()}
    frame = seen(7, 2.0)
    assert ViewChecks(**nothing).passed(frame) is frame
    np.testing.assert_array_equal(
        ViewChecks(**nothing, knocks=knocks).passed(frame).images[1], knocks.undone(frame).images[1]
    )
