"""A limb that looks like the room is told, for nobody would miss it."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_matching.camouflage import FEET
from mocapflow_recovery import limb_search
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_recovery.limb_visibility import camouflaged_feet, camouflaged_limbs, occluded_legs
from mocapflow_recovery.trimaps import small_rooms, trimaps

from mocapflow.data import NO_CLOTH
from mocapflow.geometry.cameras import project
from mocapflow.testing import pictures, recovery, scenes

SCENE = scenes.tiny_scene()
POSE = scenes.tiny_pose(SCENE, 3, 0.1)
FRAME = pictures.tiny_frame(SCENE, POSE)
SURFACE = SCENE.surface(POSE, NO_CLOTH)


def without_feet():
    """Return the frame as if below the knees there were only the room."""
    knee = SURFACE.vertices[SCENE.body.main_joint == SCENE.body.joint("knee_l")][:, 2].max()
    top = np.array([[*SURFACE.vertices[:, :2].mean(axis=0), knee]])
    images = []
    for image, room, camera in zip(FRAME.images, SCENE.background.mean, SCENE.cameras, strict=True):
        row = max(int(project(top, camera)[0, 1]) - 12, 0)
        images.append(np.vstack([image[:row], room[row:].astype(np.uint8)]))
    return replace(FRAME, images=tuple(images))


def seen(frame):
    return trimaps(frame, SURFACE, small_rooms(SCENE.background, SCENE.cameras), 0.35)


def test_limbs_that_differ_from_the_room_are_not_told():
    assert camouflaged_limbs(SURFACE, seen(FRAME), SCENE.body) == {}


def test_limbs_that_look_like_the_room_are():
    told = camouflaged_limbs(SURFACE, seen(without_feet()), SCENE.body)
    assert set(told) == {name for name in SCENE.body.joint_names if name.startswith("knee")}
    assert max(told.values()) < 0.1


def test_the_search_warns_of_them_in_the_first_frame(caplog):
    state = pictures.tiny_state(SCENE, POSE, POSE)
    fitted, past = recovery.settled(state, scene=SCENE), replace(scenes.tiny_past(SCENE, POSE), moments=())
    search = LimbSearch(beginnings=False, uncovered_cm2=1e6, floating_cm2=1e6)
    search.recover(without_feet(), state, fitted, past, scenes.tiny_model(SCENE), lambda *_: fitted)
    assert any("from knee_l on" in said.getMessage() for said in caplog.records)


@pytest.mark.parametrize(("share", "moves"), [(0.3, True), (0.02, False)])
def test_feet_that_look_like_the_room_are_told_from_others(share, moves):
    """With what moves with them, so that nothing tells of an ankle."""
    body = SCENE.body
    ankle, knee = body.joint("ankle_l"), body.joint("knee_l")
    feet, shank = np.isin(body.main_joint, [ankle, body.joint("ankle_r")]), np.flatnonzero(body.main_joint == knee)[0]
    carriers, weights = body.skin_joint.copy(), body.skin_weight.copy()
    carriers[shank], weights[shank] = [knee, ankle, 0, 0, 0], [1 - share, share, 0, 0, 0]
    body = replace(body, skin_joint=carriers, skin_weight=weights)
    told = camouflaged_feet(SURFACE, seen(without_feet()), body)
    assert told[feet].all()
    assert told[shank] == moves
    assert not camouflaged_feet(SURFACE, seen(FRAME), body).any()


@pytest.mark.parametrize(
    ("frame", "floor_m", "first", "known"),
    [
        (without_feet(), 0.0, True, True),
        (FRAME, 0.0, True, False),
        (without_feet(), None, True, False),
        (without_feet(), 0.0, False, False),
    ],
    ids=["white socks", "others", "on a floor with colours", "in a later frame"],
)
def test_later_frames_are_told_what_the_first_shows(frame, floor_m, first, known, monkeypatch, caplog):
    monkeypatch.setattr(limb_search, "no_shadows", lambda *_: None)  # two small views tell nothing together
    scene = replace(SCENE, background=replace(SCENE.background, floor_m=floor_m))
    state, past = pictures.tiny_state(scene, POSE, POSE), scenes.tiny_past(scene, POSE)
    fitted = recovery.settled(state, scene=scene)
    search = LimbSearch(beginnings=False, uncovered_cm2=1e6, floating_cm2=1e6)
    past = replace(past, moments=()) if first else past
    found = search.recover(frame, state, fitted, past, scenes.tiny_model(scene), lambda *_: fitted)
    assert (FEET in found.state.segmentation.appearance) == known
    assert ("the feet look like the floor" in caplog.text) == known


@pytest.mark.parametrize(
    ("views", "told"), [((), ()), ((1,), ("cam02",)), ((0, 1), ("cam01", "cam02")), ((0, 1, 2), ())]
)
def test_legs_are_told_that_some_views_show_nothing_of_though_others_do(views, told):
    """Furniture stands before them there; what most views lack is elsewhere."""
    images, behind_furniture = list(FRAME.images), without_feet().images
    for view in views:
        images[view] = behind_furniture[view]
    legs = ["knee_l", "knee_r"]
    found = occluded_legs(SURFACE, seen(replace(FRAME, images=tuple(images))), SCENE.body)
    assert found == {camera: legs for camera in told}


def test_where_no_view_shows_anything_surely_no_leg_is_told():
    assert occluded_legs(SURFACE, [], SCENE.body) == {}


def test_the_search_warns_of_furniture_before_legs_in_the_first_frame(caplog):
    state, images = pictures.tiny_state(SCENE, POSE, POSE), list(FRAME.images)
    images[1] = without_feet().images[1]
    fitted, past = recovery.settled(state, scene=SCENE), replace(scenes.tiny_past(SCENE, POSE), moments=())
    search = LimbSearch(beginnings=False, uncovered_cm2=1e6, floating_cm2=1e6)
    hidden = replace(FRAME, images=tuple(images))
    search.recover(hidden, state, fitted, past, scenes.tiny_model(SCENE), lambda *_: fitted)
    assert "paint that white in occluders/cam02.png" in caplog.text
    caplog.clear()
    search.recover(FRAME, state, fitted, past, scenes.tiny_model(SCENE), lambda *_: fitted)
    assert "occluders" not in caplog.text
