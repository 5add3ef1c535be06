"""Shadows on one floor, seen by several cameras: what only one of them sees is no shadow."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mocapflow_levelset.floor_height import floor_height, grey_floor
from mocapflow_levelset.floor_light import small_views
from mocapflow_levelset.shadow_consistency import _enlarged, contradicted, no_shadows
from mocapflow_levelset.shadows import floor_around, shadowed
from mocapflow_sequence.background import EmptyScene

from mocapflow.assets import Background
from mocapflow.data import NO_CLOTH, Frame, Start
from mocapflow.testing import scenes

SCENE = scenes.tiny_scene()
CAMERAS = SCENE.cameras
POSE = scenes.tiny_pose(SCENE)
BODY = SCENE.surface(POSE, NO_CLOTH)
FLOOR_M, GREY = 0.13, (170, 172, 171)
SOCK = np.s_[170:200, 20:50]  # rows and columns of a view


def places(camera, floor_m):
    """Return x, y (H, W) m of where each pixel's ray meets the floor, NaN above the horizon."""
    width, height = camera.size
    pixels = np.stack([*np.meshgrid(np.arange(width), np.arange(height)), np.ones((height, width))], axis=-1)
    turn, centre = (
        camera.camera_from_world[:3, :3],
        -camera.camera_from_world[:3, :3].T @ camera.camera_from_world[:3, 3],
    )
    rays = pixels @ np.linalg.inv(camera.intrinsics).T @ turn
    down = rays[..., 2] < 0
    far = (floor_m - centre[2]) / np.where(down, rays[..., 2], np.nan)
    return centre[:2] + far[..., None] * rays[..., :2]


def pictures(colour=GREY, floor_m=FLOOR_M, shadow=0.7, sock=0.85, seed=0):
    """Return a frame and its empty scene: a round soft shadow on a floor, and what looks like one in the first view."""
    random, shown, empty = np.random.default_rng(seed), [], []
    for number, camera in enumerate(CAMERAS):
        away = np.linalg.norm(places(camera, floor_m) - [0.2, -0.1], axis=-1)
        light = 1 - (1 - shadow) * np.clip(1.5 - np.nan_to_num(away, nan=9) / 0.3, 0, 1)
        if number == 0:
            light[SOCK] = sock
        room = np.ones((*light.shape, 3)) * colour
        empty.append(room.astype(np.float32))
        shown.append(np.clip(room * light[..., None] + random.normal(0, 2, room.shape), 0, 255).astype(np.uint8))
    background = Background(mean=tuple(empty), spread=tuple(np.full_like(mean, 3.0) for mean in empty))
    return Frame(index=0, time=0.0, images=tuple(shown), usable=np.ones(len(CAMERAS), bool)), background


def test_what_one_view_alone_sees_is_no_shadow():
    frame, background = pictures()
    told = contradicted(small_views(frame, background, CAMERAS), FLOOR_M)
    assert told[0][SOCK][3:-3, 3:-3].mean() > 0.9
    assert told[0].sum() <= 32**2  # smoothing adds a pixel around it
    assert sum(int(mask.sum()) for mask in told[1:]) == 0


def test_at_another_height_views_contradict_true_shadows():
    frame, background = pictures(sock=1.0)
    views = small_views(frame, background, CAMERAS)
    assert not any(mask.any() for mask in contradicted(views, FLOOR_M))
    assert any(mask.any() for mask in contradicted(views, FLOOR_M + 0.2))


@pytest.mark.parametrize("floor_m", [0.0, 0.13])
def test_shadows_tell_the_height_of_the_floor(floor_m):
    frames = [pictures(floor_m=floor_m, seed=seed) for seed in range(2)]
    found = floor_height([frame for frame, _ in frames], frames[0][1], CAMERAS, floor_m + 0.07)
    assert found == pytest.approx(floor_m, abs=0.015)


def test_without_a_shadow_nothing_tells_it():
    frame, background = pictures(shadow=1.0, sock=1.0)
    assert floor_height([frame], background, CAMERAS, 0.1) is None


def test_only_a_floor_without_colours_needs_the_others():
    assert grey_floor(pictures()[1], CAMERAS, BODY)
    assert not grey_floor(pictures(colour=(90, 140, 180))[1], CAMERAS, BODY)
    room = pictures()[1]
    for number, (mean, spread) in enumerate(zip(room.mean, room.spread, strict=True)):
        unknown = np.s_[:, : 220 if number else None]  # of one view all
        mean[unknown], spread[unknown] = (90, 140, 180), np.inf
    assert grey_floor(room, CAMERAS, BODY)


@pytest.mark.parametrize(("colour", "found"), [(GREY, FLOOR_M), ((90, 140, 180), None)])
def test_the_stage_looks_for_a_floor_without_colours(colour, found):
    _, room = pictures(colour)
    recording = SimpleNamespace(length=8, frame=lambda index: pictures(colour, seed=index)[0])
    floor_m = EmptyScene()._floor(room, recording, SCENE, Start(pose=POSE, parameters=np.empty(0)))
    assert floor_m == (found if found is None else pytest.approx(found, abs=0.015))


def test_shadows_may_fall_where_the_others_see_them():
    frame, background = pictures()
    around = floor_around(BODY, CAMERAS[0])
    unknown = shadowed(frame, BODY, SCENE.with_background(background), 0)
    np.testing.assert_array_equal(unknown, around)
    scene = SCENE.with_background(replace(background, floor_m=FLOOR_M))
    told = around & ~shadowed(frame, BODY, scene, 0)
    assert told[SOCK].mean() > 0.7
    assert told.sum() <= 32**2  # smoothing adds a pixel around it


def test_two_views_are_too_few():
    frame, background = pictures()
    background = replace(background, floor_m=FLOOR_M)
    some = replace(frame, usable=np.array([True, True, False, False]))
    assert no_shadows(some, background, CAMERAS) is None
    three = no_shadows(replace(frame, usable=np.array([True, True, True, False])), background, CAMERAS)
    assert three is not None and three[0][SOCK].mean() > 0.7


def test_what_was_left_over_when_a_view_was_shrunk_is_its_lower_right_rim():
    small = np.array([[True, False, True], [False, True, False]])
    large = _enlarged(small, 2, replace(CAMERAS[0], size=np.array([7, 5], np.int32)))
    np.testing.assert_array_equal(large, np.pad(small.repeat(2, axis=0).repeat(2, axis=1), ((0, 1), (0, 1))))


def test_what_is_hidden_tells_nothing():
    frame, background = pictures()
    hidden = tuple(np.full(image.shape[:2], number > 0) for number, image in enumerate(frame.images))
    views = small_views(replace(frame, hidden=hidden), background, CAMERAS)
    assert not any(mask.any() for mask in contradicted(views, FLOOR_M))
