"""Medians over neighbours and over three frames: noise and what flies past go, edges that move stay."""

import cv2
import numpy as np
import pytest
from mocapflow_robustness.calm import Calm, middle
from mocapflow_robustness.corrupt import Corrupt
from mocapflow_robustness.events import Event
from pydantic import ValidationError

from mocapflow.recording import open_recording
from tests.fixtures.stores import write_recording

FRAMES = 8


def scene(index):
    """A bright half that moves two pixels to the right in each frame."""
    image = np.full((16, 24, 3), 60, np.uint8)
    image[:, 2 + 2 * index :] = 180
    return image


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = write_recording(tmp_path_factory.mktemp("calm") / "clip", frames=FRAMES)
    for camera in ("cam01", "cam02"):
        for index in range(FRAMES):
            cv2.imwrite(str(folder / f"videos/{camera}/{index:06}.png"), scene(index))
    return folder


def test_the_middle_one_of_three():
    values = np.random.default_rng(0).integers(0, 256, (3, 5, 7, 3), np.uint8)
    assert (middle(*values) == np.median(values, axis=0)).all()


def test_a_moving_edge_stays_where_it_is(clip):
    calm = Calm(width_px=0).run(open_recording(clip))
    assert all((frame.images[0] == scene(frame.index)).all() for frame in list(calm.frames())[1:-1])
    assert [frame.index for frame in calm.frames()] == list(range(FRAMES))
    assert (calm.frame(0).images[0] == scene(1)).all()  # the first has no neighbour before it


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_recording_of_few_frames(tmp_path, frames):
    recording = Calm().run(open_recording(write_recording(tmp_path / "clip", frames=frames)))
    assert [frame.index for frame in recording.frames()] == list(range(frames))
    assert recording.frame(frames - 1).index == frames - 1


def test_what_lasts_for_a_frame_is_gone(clip):
    spoiled = Corrupt(rectangles=(1, 1), seed=3).run(open_recording(clip))
    calm = Calm(width_px=0).run(spoiled)
    wrong = [
        np.mean([(f.images[0] != scene(f.index)).mean() for f in recording.frames() if 0 < f.index < FRAMES - 1])
        for recording in (spoiled, calm)
    ]
    assert wrong[0] > 0.01
    assert wrong[1] < 0.3 * wrong[0], wrong


def test_replaced_pixels_are_filled_from_their_neighbours(clip):
    spoiled = Corrupt(noise=0.6).run(open_recording(clip))
    off = [
        np.median(np.abs(recording.frame(4).images[0].astype(int) - scene(4)).max(axis=2))
        for recording in (spoiled, Calm(width_px=5).run(spoiled))
    ]
    assert off[0] > 50
    assert off[1] < 20


def test_a_frame_is_the_same_whoever_asks_and_a_lost_view_is_no_neighbour(clip):
    dropped = Corrupt(noise=0.5, events=(Event(what="dropped", first=5, count=1, views=("cam02",)),))
    calm = Calm(width_px=3).run(dropped.run(open_recording(clip)))
    every = {frame.index: frame for frame in calm.frames()}
    assert list(every) == list(range(FRAMES))
    assert all((calm.frame(k).images[0] == every[k].images[0]).all() for k in (0, 3, FRAMES - 1))
    assert all((frame.images[0] == every[frame.index].images[0]).all() for frame in calm.frames(since=6))
    assert every[5].usable.tolist() == [True, False]
    alone = Calm(width_px=3, across_time=False).run(dropped.run(open_recording(clip)))
    assert (alone.frame(4).images[1] == every[4].images[1]).all()


def test_the_width_has_a_middle():
    with pytest.raises(ValidationError, match="an odd number"):
        Calm(width_px=4)
