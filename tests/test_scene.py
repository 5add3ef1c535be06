"""What a scene knows beside the person: what stands before them."""

from dataclasses import replace

import numpy as np

from mocapflow.data import Matches
from mocapflow.testing import pictures, scenes
from mocapflow.testing.views import SIZE


def matches(pixels, camera):
    count = len(pixels)
    return Matches(
        camera=np.full(count, camera, np.int16), pixel=np.array(pixels, float), direction=np.zeros((count, 2)),
        vertex=np.arange(count, dtype=np.int32), weight=np.ones(count),
    )  # fmt: skip


def hiding(scene, rows):
    """The scene behind a bar in its first view."""
    hidden = [np.zeros(SIZE[::-1], bool) for _ in scene.cameras]
    hidden[0][rows] = True
    return scene.with_background(replace(scene.background, hidden=tuple(hidden)))


def test_a_match_behind_what_hides_the_person_is_left_out():
    scene = scenes.tiny_scene()
    found = matches([[10, 99], [10, 100.4], [12, 120], [400, -3]], 0)
    frame = pictures.tiny_frame(scene, scenes.tiny_pose(scene))
    assert scene.unhidden(found, frame) is found
    behind = hiding(scene, slice(100, 110))
    assert behind.unhidden(found, frame).vertex.tolist() == [0, 2, 3]
    assert len(behind.unhidden(matches([[10, 105]], 1), frame).vertex) == 1
    dark = replace(frame, hidden=tuple(np.repeat([[[True]]], SIZE[1], axis=1).repeat(SIZE[0], axis=2)) * 4)
    assert len(scene.unhidden(found, dark).vertex) == 0
    assert behind.hidden(dark, 0).all() and scene.hidden(frame, 0) is None


def test_segmenters_keep_to_the_model_where_the_person_is_hidden():
    from mocapflow_levelset.background import BackgroundDifference
    from mocapflow_levelset.levelset import LevelSet

    from mocapflow.data import Past, Turn

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
        for known in (scene, hiding(scene, rows)):
            found = segmenter.segment(spoiled, state, Past(), known, Turn(index=0, cap=8)).of("person")[0]
            off.append(np.count_nonzero((found.distance > 0)[rows] != truth[0][rows]))
        assert off[1] < 0.2 * off[0]
        assert off[1] < 0.1 * np.count_nonzero(truth[0][rows])
