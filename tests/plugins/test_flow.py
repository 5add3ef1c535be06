"""Points followed between pictures whose motion is known, and how they come to the frames of the loop."""

import cv2
import numpy as np
import pytest
from mocapflow_sequence.flow import FollowPoints

from mocapflow.assets import Background
from mocapflow.caching.digests import Digests
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Frame
from mocapflow.recordings.recording import open_recording
from mocapflow.running.recipes import steps_of
from mocapflow.running.runner import run
from mocapflow.storage.store import Store
from mocapflow.testing.same import same
from tests.fixtures.stores import PLUGIN, STAGES, write_pipeline, write_recording

SHIFT = np.array([5.3, -2.6])


def pattern(seed=0, shape=(120, 160)):
    noise = np.random.default_rng(seed).uniform(0, 255, (*shape, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2)
    return np.clip(128 + 5 * (smooth - smooth.mean()), 0, 255).astype(np.uint8)


def shifted(picture, by):
    matrix = np.array([[1, 0, by[0]], [0, 1, by[1]]])
    return cv2.warpAffine(picture, matrix, picture.shape[1::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


@pytest.mark.parametrize("factor", [0.3, 1.0, 4.0])
def test_a_shift_is_found_to_a_tenth_of_a_pixel(factor):
    old = pattern()
    flow = FollowPoints().follow(old, shifted(old, factor * SHIFT))
    inside = ((flow.pixel > 12) & (flow.pixel < [147, 107])).all(axis=1)
    assert inside.sum() > 100
    error = np.linalg.norm(flow.displacement - factor * SHIFT, axis=1)[inside]
    assert np.median(error) < 0.1
    assert np.percentile(error, 95) < 0.5


def test_what_does_not_come_back_is_dropped():
    """Half of the picture is replaced: hardly a point is followed there."""
    old, new = pattern(), pattern()
    new[:, 80:] = pattern(1)[:, 80:]
    gone = FollowPoints().follow(old, new).pixel[:, 0] > 90
    anyway = FollowPoints(round_trip_px=1e6).follow(old, new).pixel[:, 0] > 90
    assert gone.sum() < 0.3 * anyway.sum()


def test_points_lie_on_what_differs_from_the_empty_scene_or_where_nobody_knows_it():
    room = pattern(2)
    old = room.copy()
    old[40:90, 60:110] = pattern()[40:90, 60:110]
    flow, stage = [], FollowPoints(spacing_px=2)
    for nobody_knows in (np.s_[:0], np.s_[:20, :50]):
        spread = np.ones(room.shape, np.float32)
        spread[nobody_knows] = np.inf
        background = Background(mean=(room.astype(np.float32),), spread=(spread,))
        flow.append(stage.follow(old, old, stage.differs(old, background, 0)).pixel)
    on_it = [((pixel >= [58, 38]) & (pixel <= [111, 91])).all(axis=1) for pixel in flow]
    assert on_it[0].sum() > 20 and on_it[0].all()
    assert on_it[1].sum() > 20 and (flow[1][~on_it[1]] < [50, 20]).all() and (~on_it[1]).sum() > 5


def test_what_hides_the_scene_is_not_followed():
    picture, usable = pattern(), np.ones(1, bool)
    hidden = np.zeros(picture.shape[:2], bool)
    hidden[50:70] = True
    frames = [Frame(index=k, time=k / 30, images=(picture,), usable=usable, hidden=(hidden,)) for k in (0, 1)]
    dark, one = np.zeros(picture.shape, np.float32), np.ones(picture.shape, np.float32)
    for background in (None, Background(mean=(dark,), spread=(one,))):
        _, (_, _, flow) = FollowPoints(window_px=11)._parts(frames, background)
        row = flow.pixel[:, 1]
        assert (row < 45).any() and (row > 74).any() and not ((row >= 45) & (row <= 74)).any()


def test_at_most_so_many_points():
    assert len(FollowPoints(points=7).follow(pattern(), pattern()).pixel) == 7
    assert len(FollowPoints().follow(np.zeros((40, 40, 3), np.uint8), pattern()[:40, :40]).pixel) == 0


def test_frames_get_what_was_followed_into_them(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=4)
    for step in (1, 2):
        recording = open_recording(clip, step=step)
        flow = FollowPoints(spacing_px=1, round_trip_px=1e3).run(recording)
        assert sorted(set(flow.frame)) == list(recording.indices)[1:]
        first, second = (list(recording.frames())[k].images[1] for k in (0, 1))
        expected = FollowPoints(spacing_px=1, round_trip_px=1e3).follow(first, second)
        assert same(flow.into(step)[1], expected)
        assert [len(view.pixel) for view in flow.into(0)] == [0, 0]
        assert sum(len(view.pixel) for k in recording.indices for view in flow.into(k)) == len(flow.frame)


LOOKING = """
from mocapflow import Predictor, hookimpl


class Looking(Predictor):
    '''Writes down how much flow it gets.'''

    name = "looking"
    out: str

    def predict(self, frame, past, scene):
        with open(self.out, "a") as file:
            print(frame.index, *(len(view.pixel) for view in frame.flow), file=file)
        return past.moments[-1].pose


@hookimpl
def mocapflow_predictors():
    return [Looking]
"""


def pipeline_with_flow(folder, clip, frames=None):
    (folder / "looking.py").write_text(LOOKING)
    track = STAGES["track"] | {"predictor": {"use": "looking", "out": str(folder / "seen.txt")}}
    follow = {"use": "flow", "spacing_px": 1, "round_trip_px": 1000}
    stages = {"start": "tiny_start", "flow": follow, "track": track, "smooth": "tiny_smooth"}
    path = write_pipeline(folder, clip, stages=stages, plugins=[str(PLUGIN), "./looking.py"])
    return load_pipeline(path, frames=None if frames is None else slice(0, frames))


def test_the_loop_hands_the_flow_to_its_steps(tmp_path):
    pipeline = pipeline_with_flow(tmp_path, write_recording(tmp_path / "clip", frames=4))
    run(pipeline, store=tmp_path / "store.zarr", out=tmp_path / "out")
    store = Store(tmp_path / "store.zarr")
    (kept,) = [store.load(a) for a in store.artifacts() if a.path.name.startswith("flow-")]
    seen = [[int(word) for word in line.split()] for line in (tmp_path / "seen.txt").read_text().splitlines()]
    assert seen == [[k, *(len(view.pixel) for view in kept.into(k))] for k in (1, 2, 3)]
    assert sum(sum(counts) for _, *counts in seen) > 0


@pytest.mark.long
def test_a_longer_run_follows_anew_but_the_track_goes_on(tmp_path):
    clip, digests = write_recording(tmp_path / "clip", frames=4), Digests()
    whole, part = (
        {step.label: step.key for step in steps_of(pipeline_with_flow(tmp_path, clip, frames), digests)}
        for frames in (None, 3)
    )
    assert {label for label in whole if whole[label] != part[label]} == {"flow", "smooth"}
