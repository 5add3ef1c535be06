"""Stages that restore pictures leave good ones alone, and what was hidden before them stays hidden."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_robustness.bilateral import Bilateral
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.denoise import Denoise
from mocapflow_robustness.restoring import mean_around

from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from tests.fixtures.stores import write_recording


@pytest.fixture(params=[Bilateral(), Denoise()], ids=lambda stage: stage.name)
def restorer(request):
    return request.param


def test_pictures_without_noise_stay_as_they_are(restorer):
    recording = open_recording(shipped("examples", "data", "skirt_steps"))
    first = replace(recording, indices=range(1))
    clean, same = first.frame(0), restorer.run(first).frame(0)
    assert all((one == other).all() for one, other in zip(clean.images, same.images, strict=True))
    assert not any(hidden.any() for hidden in same.hidden)


def test_what_was_hidden_stays_hidden(restorer, tmp_path):
    recording = open_recording(write_recording(tmp_path / "clip", frames=3))
    covered = Corrupt(events=({"what": "covered", "first": 1, "count": 1},)).run(recording)
    before, after = (list(each.frames()) for each in (covered, restorer.run(covered)))
    assert all((after[1].hidden[c] | ~before[1].hidden[c]).all() for c in range(2))
    assert before[1].hidden[0].any()
    assert [frame.index for frame in after] == [0, 1, 2]


def test_the_mean_around_a_pixel_is_that_of_known_ones():
    image = np.full((9, 9, 3), 200, np.uint8)
    image[:, 5:] = 0
    known = np.arange(9) < 5
    mean, share = mean_around(image, np.broadcast_to(known, (9, 9)), 1.0)
    assert np.allclose(mean[:, :7], 200, atol=1e-3)
    assert share[4, 0] > 0.9
    assert share[4, 7] < 0.1
