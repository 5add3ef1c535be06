"""The body has to stay inside the silhouette, and is left alone there."""

from dataclasses import replace
from functools import partial

import matching_scenes
import numpy as np
import pytest
from matching_scenes import FIRST, FRAME, seen
from mocapflow_matching.containment import Containment
from mocapflow_matching.robust import robust_weights

from mocapflow.data import CLOTH, NO_CLOTH, Past
from mocapflow.geometry.cameras import project
from mocapflow.geometry.contours import at_nearest
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.testing import tiny_pose, tiny_scene

SCENE = tiny_scene(clothed=True)
BARE = tiny_scene()
surface_at = partial(matching_scenes.surface_at, scene=SCENE)
bent = partial(matching_scenes.bent, scene=SCENE)  # the leg sticks out of the tube, the cloth stays


@pytest.fixture(scope="module")
def truth():
    return tiny_pose(SCENE)


def match(surface, segmentation, scene=SCENE, **settings):
    return Containment(**settings).match(FRAME, segmentation, surface, Past(), scene, FIRST)


def test_a_bare_body_is_held_too(truth):
    shown = seen(BARE.surface(truth, NO_CLOTH), BARE)
    assert len(match(BARE.surface(truth, NO_CLOTH), shown, BARE, margin_px=-1.0).vertex) == 0
    assert len(match(BARE.surface(bent(truth, 20), NO_CLOTH), shown, BARE).vertex) > 10


def test_silent_while_the_body_is_inside(truth):
    surface = surface_at(truth)
    matches = match(
        surface, seen(surface, SCENE), margin_px=-1.0
    )  # the field is of whole edges, looked up at whole pixels
    assert len(matches.vertex) == 0


def test_a_leg_within_the_cloth_is_not_drawn_to_it(truth):
    """One-sided: a garment twice as wide as the leg pulls nothing."""
    pose = bent(truth, 3)
    shown = seen(surface_at(truth), SCENE)
    bare = SCENE.bare(surface_at(pose))
    matches = match(surface_at(pose), shown)
    for camera in range(4):
        view = SCENE.cameras[camera]
        contour = occluding_contour(bare, view, 6.0)
        depth = at_nearest(shown.silhouettes[camera].distance, contour.pixel)
        inside, out = contour.vertex[depth > 2], contour.vertex[depth <= 2]
        touched = set(matches.vertex[matches.camera == camera].tolist())
        assert len(inside) > 10
        assert not touched & (set(inside.tolist()) - set(out.tolist()))


def test_where_a_partial_body_was_cut_off_nothing_is_matched(truth):
    """The silhouette may end before the rim, which would then be drawn down with the body."""
    surface, shown = surface_at(bent(truth, 25)), seen(surface_at(truth), SCENE)
    usual = match(surface, shown)
    rim = np.isin(np.arange(len(SCENE.body.vertices)), usual.vertex[::2])
    part = replace(SCENE, body=replace(SCENE.body, cut=rim))
    cut = match(surface, shown, part)
    assert len(cut.vertex) > 5
    assert sorted(cut.vertex) == sorted(usual.vertex[~rim[usual.vertex]])


def test_what_sticks_out_is_drawn_to_the_contour(truth):
    surface, shown = surface_at(bent(truth, 25)), seen(surface_at(truth), SCENE)
    matches = match(surface, shown)
    assert len(matches.vertex) > 20
    assert (surface.layer[matches.vertex] != CLOTH).all()
    views = np.array([project(surface.vertices, camera) for camera in SCENE.cameras])
    way = np.sum((matches.pixel - views[matches.camera, matches.vertex]) * matches.direction, axis=1)
    np.testing.assert_allclose(np.linalg.norm(matches.direction, axis=1), 1)
    assert (way < 0.75).all()  # inward; the field was looked up half a pixel's diagonal away
    assert way.min() < -10
    names = np.array(SCENE.body.joint_names)[SCENE.body.skin_joint[matches.vertex[way < -5], 0]]
    assert set(names) == {"hip_l"}  # the first of the joints that carry the left leg
    np.testing.assert_allclose(matches.weight, robust_weights(np.abs(way), "huber", 3.0), atol=1e-9)


def test_the_margin_keeps_the_skin_further_inside(truth):
    surface, shown = surface_at(bent(truth, 25)), seen(surface_at(truth), SCENE)
    plain, further = match(surface, shown), match(surface, shown, margin_px=4.0)
    assert len(further.vertex) > len(plain.vertex)
    views = np.array([project(surface.vertices, camera) for camera in SCENE.cameras])
    ways = [np.sum((m.pixel - views[m.camera, m.vertex]) * m.direction, axis=1) for m in (plain, further)]
    assert ways[1].min() == pytest.approx(ways[0].min() - 4.0, abs=1e-9)
