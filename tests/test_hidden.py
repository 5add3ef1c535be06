"""What stands before the scene is no evidence for either side."""

from dataclasses import replace

import numpy as np
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.levelset import LevelSet

from mocapflow.data import Matches, Past, Turn
from mocapflow.loop import unhidden
from mocapflow.testing import pictures, scenes
from mocapflow.testing.views import SIZE


def matches(pixels, camera):
    count = len(pixels)
    return Matches(
        camera=np.full(count, camera, np.int16), pixel=np.array(pixels, float), direction=np.zeros((count, 2)),
        vertex=np.arange(count, dtype=np.int32), weight=np.ones(count),
    )  # fmt: skip


def behind_bar(frame, rows):
    """The frame with a bar before its first view."""
    hidden = [np.zeros(SIZE[::-1], bool) for _ in frame.images]
    hidden[0][rows] = True
    return replace(frame, hidden=tuple(hidden))


def test_a_match_behind_what_hides_the_scene_is_left_out():
    scene = scenes.tiny_scene()
    found = matches([[10, 99], [10, 100.4], [12, 120], [400, -3]], 0)
    frame = pictures.tiny_frame(scene, scenes.tiny_pose(scene))
    assert unhidden(found, frame) is found and frame.hidden_in(0) is None
    barred = behind_bar(frame, slice(100, 110))
    assert unhidden(found, barred).vertex.tolist() == [0, 2, 3]
    assert len(unhidden(matches([[10, 105]], 1), barred).vertex) == 1
    assert barred.hidden_in(0)[100:110].all() and not barred.hidden_in(1).any()


def test_segmenters_keep_to_the_model_where_the_person_is_hidden():
    scene, rows = scenes.tiny_scene(), slice(110, 140)
    pose = scenes.tiny_pose(scene, 3, 0.1)
    frame, state, truth = (
        pictures.tiny_frame(scene, pose),
        pictures.tiny_state(scene, pose),
        pictures.tiny_masks(scene, pose),
    )
    barred = frame.images[0].copy()
    barred[rows] = 0
    spoiled = replace(frame, images=(barred, *frame.images[1:]))
    for segmenter in (BackgroundDifference(), LevelSet()):
        off = []
        for given in (spoiled, behind_bar(spoiled, rows)):
            found = segmenter.segment(given, state, Past(), scene, Turn(index=0, cap=8)).of("person")[0]
            off.append(np.count_nonzero((found.distance > 0)[rows] != truth[0][rows]))
        assert off[1] < 0.2 * off[0]
        assert off[1] < 0.1 * np.count_nonzero(truth[0][rows])
