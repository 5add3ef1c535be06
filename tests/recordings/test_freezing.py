"""Cameras that hang, and those that do not though they show next to nothing new."""

import numpy as np
import pytest

from mocapflow.recordings.freezing import difference, frozen_from, repeated

FRAMES, CAMERAS = 60, 4


@pytest.fixture
def news():
    """Four cameras that see things move."""
    made = np.random.default_rng(0).uniform(0.8, 1.2, (FRAMES, CAMERAS))
    made[0] = np.nan
    return made


def hang(news, camera, first, every=12):
    """One repeats a picture, which a codec draws anew now and then: worse at first, better in the frame after that."""
    news[first:, camera] = 0.004
    news[first + 6 :: every, camera], news[first + 7 :: every, camera] = 0.9, 0.2
    news[0] = np.nan


@pytest.mark.parametrize("first", [0, 5, 30, 52])
def test_a_camera_that_hangs_to_the_end(news, first):
    hang(news, 2, first)
    assert frozen_from(news).tolist() == [FRAMES, FRAMES, first, FRAMES]


def test_what_is_missing_at_the_end_does_not_hang(news):
    news[30:, 2] = np.nan
    assert (frozen_from(news) == FRAMES).all()


def test_a_pause_is_no_hang_nor_is_a_camera_that_sees_it_a_little_earlier(news):
    news[40:] = 0.01
    news[38:40, 2] = 0.05
    assert (frozen_from(news) == FRAMES).all()


def test_the_pose_of_a_camera_that_hangs_is_wrong_in_a_pause_too(news):
    hang(news, 2, 30)
    news[40:] *= 0.01
    assert frozen_from(news)[2] == 30


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_too_few_frames_tell_nothing(frames):
    news = np.ones((frames, CAMERAS))
    news[:, 1], news[0] = 0.0, np.nan
    assert (frozen_from(news) == frames).all()


def test_a_far_camera_sees_little_news_and_does_not_hang(news):
    news[:, 1] *= 0.15
    assert (frozen_from(news) == FRAMES).all() and not repeated(news).any()


def test_who_stands_still_is_not_frozen_though_one_view_sees_a_bystander_move(news):
    news[10:15, :3] = 0.01
    assert not repeated(news).any()
    news[10:15, 2] = 1.0
    assert np.argwhere(repeated(news)).tolist() == [[row, view] for row in range(10, 15) for view in (0, 1)]
    assert not repeated(np.full((1, 4), np.nan)).any()  # a recording of one frame


def test_a_long_repeat_is_told_to_its_end(news):
    """Two thirds of the recording: the median of such a camera is what a codec adds."""
    news[10:50, 1] = np.random.default_rng(1).uniform(0.002, 0.006, 40)
    assert np.flatnonzero(repeated(news)[:, 1]).tolist() == list(range(10, 50))
    assert (frozen_from(news) == FRAMES).all()  # it goes on


def test_a_picture_differs_by_grey_levels():
    picture = np.full((8, 8, 3), 200, np.uint8)
    assert difference(picture, picture - 50) == difference(picture - 50, picture) == 50
