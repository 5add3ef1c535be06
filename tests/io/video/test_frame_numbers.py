"""Which frames pictures are, by their times."""

import numpy as np
import pytest

from mocapflow.io.video.frame_numbers import number_frames, unevenness


def test_gaps_in_the_time_stamps_are_lost_frames():
    period = 1000 / 30
    stamps = np.delete(np.arange(30) * period, [10, 11, 20])
    assert number_frames(stamps).tolist() == np.delete(np.arange(30), [10, 11, 20]).tolist()
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, 30) * period
    assert number_frames(np.arange(30) * period + jitter).tolist() == list(range(30))
    assert number_frames(np.round(np.arange(3000) * period)).tolist() == list(range(3000))  # times in whole ms
    kept = np.delete(np.arange(300), [40, 41, 90, 200])
    for rate in (150, 180):  # whole milliseconds, at which the median is far from the period
        assert number_frames(np.round(kept * 1000 / rate)).tolist() == kept.tolist()
    late = np.array([0, 1, 2.6, 3, 4.7, 5, 6, 9, 10, 12.6, 13, 14])  # 7, 8 and 11 are lost
    assert number_frames(late).tolist() == [0, 1, 2, 3, 4, 5, 6, 9, 10, 12, 13, 14]
    held = np.arange(30.0)
    held[3:8] = [7.5, 7.6, 7.7, 7.8, 7.9]  # five that come at once, before the next is due
    assert number_frames(held).tolist() == list(range(30))
    assert number_frames(np.zeros(4)).tolist() == [0, 1, 2, 3]
    assert number_frames(np.zeros(1)).tolist() == [0]
    assert number_frames(np.array([0.0, 1, 4])).tolist() == [0, 1, 4]
    assert number_frames(np.array([0.0, 3, 1, 1, 2])).tolist() == [0, 3, 1, 1, 2]


def test_how_uneven_frames_come():
    times = np.delete(np.arange(60) * 3003, [20, 21])
    assert unevenness(times, number_frames(times)) < 1e-6
    slower = np.append(np.arange(40), 40 + 1.25 * np.arange(20))  # as of a phone in the dark
    assert unevenness(slower, number_frames(slower)) == pytest.approx(2, abs=0.5)
    assert unevenness(np.zeros(1), np.zeros(1, np.int32)) == unevenness(np.zeros(5), number_frames(np.zeros(5))) == 0
