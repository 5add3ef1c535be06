"""What is done every so often falls due as often as it should, at any rate of frames."""

import numpy as np
import pytest

from mocapflow.periodic import falls_due


@pytest.mark.parametrize("rate", [7.5, 25.0, 29.97, 30.0, 60.0, 240.0])
@pytest.mark.parametrize("every_s", [0.1, 1 / 3, 2.0])
def test_it_falls_due_once_a_period_or_in_every_frame_where_these_are_farther_apart(rate, every_s):
    times = np.arange(round(60 * rate) + 1) / rate
    due = [falls_due(last, now, every_s) for last, now in zip(times, times[1:], strict=False)]
    assert sum(due) == pytest.approx(min(60 / every_s, len(due)), abs=1)


@pytest.mark.parametrize("step", [1, 2, 4, 7])
@pytest.mark.parametrize("first", range(4))
def test_one_of_so_many_frames_whichever_are_left_out(step, first):
    times = np.arange(first, 40 * step, step) / 30
    due = [falls_due(last, now, 4 * (now - last)) for last, now in zip(times, times[1:], strict=False)]
    assert set(np.diff(np.flatnonzero(due))) == {4}
