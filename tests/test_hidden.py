"""What stands before the scene is no evidence for either side."""

from dataclasses import replace

import numpy as np
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.grabcut import GrabCut
from mocapflow_levelset.levelset import LevelSet

from mocapflow.data import NO_CLOTH, Matches, Past, Turn
from mocapflow.geometry.cameras import project
from mocapflow.pooling import unhidden
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
    pose = scenes.tiny_pose(scene)
    frame, surface, cameras = pictures.tiny_frame(scene, pose), scene.surface(pose, NO_CLOTH), scene.cameras
    found = matches([[10, 99], [10, 100.4], [12, 120], [400, -3]], 0)
    assert unhidden(found, frame, surface, cameras) is found and frame.hidden_in(0) is None
    barred = behind_bar(frame, slice(100, 110))
    assert unhidden(found, barred, surface, cameras).vertex.tolist() == [0, 2, 3]
    assert len(unhidden(matches([[10, 105]], 1), barred, surface, cameras).vertex) == 1
    assert barred.hidden_in(0)[100:110].all() and not barred.hidden_in(1).any()


def test_a_hidden_point_of_the_model_takes_no_contour_that_is_seen():
    """A leg behind a bar would take the other leg's contour, the nearest that is left."""
    scene = scenes.tiny_scene()
    pose = scenes.tiny_pose(scene)
    frame, surface = pictures.tiny_frame(scene, pose), scene.surface(pose, NO_CLOTH)
    pixels = project(surface.vertices, scene.cameras[0])
    rows = slice(130, 160)
    behind = (np.rint(pixels[:, 1]) >= rows.start) & (np.rint(pixels[:, 1]) < rows.stop)
    found = replace(matches(np.full((len(pixels), 2), 20.0), 0), vertex=np.arange(len(pixels), dtype=np.int32))
    kept = unhidden(found, behind_bar(frame, rows), surface, scene.cameras)
    assert behind.any() and kept.vertex.tolist() == np.flatnonzero(~behind).tolist()


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
    for segmenter in (BackgroundDifference(), GrabCut(), LevelSet()):
        off = []
        for given in (spoiled, behind_bar(spoiled, rows)):
            found = segmenter.segment(given, state, Past(), scene, Turn(index=0)).of("person")[0]
            off.append(np.count_nonzero((found.distance > 0)[rows] != truth[0][rows]))
        assert off[1] < 0.2 * off[0]
        assert off[1] < 0.1 * np.count_nonzero(truth[0][rows])
