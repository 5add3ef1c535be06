"""What hardly differs from the empty scene becomes the empty scene; the person stays, and so does what nobody knows."""

from dataclasses import replace

import numpy as np
from mocapflow_robustness.hysteresis import Hysteresis, cleared, linked

from mocapflow.assets import Background
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording

MEAN = np.full((40, 60, 3), (90, 120, 150), np.float32)
SPREAD = np.full((40, 60, 3), 5, np.float32)


def test_connected_parts_stay_that_hold_something_strong():
    weak = np.zeros((5, 7), bool)
    weak[1, :3] = weak[1:4, 5] = True
    strong = np.zeros((5, 7), bool)
    strong[2, 5] = strong[4, 0] = True  # the last lies in nothing weak
    expected = np.zeros((5, 7), bool)
    expected[1:4, 5] = True
    assert (linked(weak, strong) == expected).all()
    assert not linked(weak, weak & False).any()


def test_noise_goes_and_what_differs_by_much_stays_with_what_is_joined_to_it():
    noise = np.random.default_rng(0).normal(0, 5, MEAN.shape)
    image = np.clip(MEAN + noise, 0, 255).astype(np.uint8)
    image[10:30, 20:30] = (30, 40, 50)  # a person,
    image[10:14, 30:40] = (104, 134, 164)  # an arm that is hardly seen,
    image[35:38, 50:58] = (104, 134, 164)  # and as much of a stain
    result = cleared(image, MEAN, SPREAD)
    assert (result[10:30, 20:30] == image[10:30, 20:30]).all()
    assert (result[10:14, 30:40] == image[10:14, 30:40]).all()
    assert (result[35:38, 50:58] == MEAN[0, 0]).all()
    assert (result[:8] == MEAN[0, 0]).mean() > 0.99


def test_where_nobody_knows_the_empty_scene_pictures_stay():
    image = np.full(MEAN.shape, 100, np.uint8)
    spread = SPREAD.copy()
    spread[:, :20] = np.inf
    result = cleared(image, MEAN - np.float32(2.3), spread * 10)
    assert (result[:, :20] == 100).all()
    assert (result[:, 20:] == MEAN[0, 0] - 2).all()


def test_views_are_compared_with_their_own_scenes():
    recording = replace(open_recording(shipped("examples", "data", "skirt_steps")), indices=range(1))
    scenes = [
        np.full((*image.shape[:2], 3), 40 * number, np.float32)
        for number, image in enumerate(recording.frame(0).images)
    ]
    background = Background(mean=tuple(scenes), spread=tuple(np.full_like(scene, 1e3) for scene in scenes))
    shown = Hysteresis().run(recording, background)
    assert [int(image[0, 0, 0]) for image in shown.frame(0).images] == [0, 40, 80, 120]
    assert [int(image[0, 0, 0]) for image in shown.seen_by(2).frame(0).images] == [80]
