"""The empty scene learnt once more, by where a track has the person."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_sequence.background import EmptyScene
from mocapflow_sequence.learnt import Learnt
from mocapflow_sequence.revise_background import ReviseBackground, revised
from results_scene import DEMO, demo_scene, stepping

from mocapflow.assets import Background
from mocapflow.geometry.silhouettes import covered, distance_to
from mocapflow.knocks import Knocks
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ViewChecks
from tests.fixtures.patterned_room import STRIPES, taken

SOCK = np.s_[165:195, 174:180]  # of the floor behind the person in the first place, and beside them in others
SCENE = demo_scene()
TRACK = stepping(SCENE.body, 12)
RECORDING = open_recording(DEMO, stop=12)
PLATES = RECORDING.background()
LEARNT = EmptyScene(source="recording")
UNKNOWN = replace(PLATES, spread=tuple(np.full_like(plate, np.inf) for plate in PLATES.spread))
CORNER = np.s_[20:60, 20:60]  # shows the wall in every frame


def again(places, shade=1.0, wrong=None, unknown=None, toned=1.0):
    """Return the truth, what is revised, and the mask in the first place, from a room that is wrong in places."""
    shown, empty, mask, *_ = taken(places, shade)
    away = np.stack([~np.roll(mask, place, axis=1) for place in places])
    mean, spread = empty.astype(np.float32), np.full(empty.shape, 2.0, np.float32)
    if wrong is not None:
        mean[wrong] = STRIPES[wrong]
    if unknown is not None:
        mean[unknown], spread[unknown] = 0, np.inf
    mean[SOCK] *= toned
    before = Learnt(mean, spread)
    return before, revised(before, shown, away), empty, mask


def off(found, empty):
    return np.abs(found.mean - empty).max(axis=2)


def test_what_was_the_persons_gives_way_to_what_is_seen_beside_them():
    before, found, empty, mask = again([0] * 8 + [60] * 5, wrong=SOCK)
    assert mask[SOCK].mean() > 0.5
    assert found.known.all() and off(found, empty)[SOCK].max() < 12
    np.testing.assert_array_equal(found.mean[:100], before.mean[:100])  # was right


def test_what_nobody_knew_is_known_where_it_is_seen():
    _, found, empty, mask = again([0] * 8 + [60] * 5, unknown=np.s_[100:200])
    seen = ~(mask & np.roll(mask, 60, axis=1))
    assert found.known[seen].all() and off(found, empty)[seen].max() < 12
    assert abs((found.mean - empty)[100:200][seen[100:200]].mean()) < 0.5  # noise is no light
    hidden = ~seen
    hidden[:100] = hidden[200:] = False
    assert hidden.sum() > 20 and not found.known[hidden].any()


def test_what_is_never_seen_beside_the_person_stays_as_it_was():
    before, found, _, mask = again([0] * 13, wrong=SOCK, unknown=np.s_[150:200])
    np.testing.assert_array_equal(found.mean[mask], before.mean[mask])
    np.testing.assert_array_equal(found.spread[mask], before.spread[mask])
    assert found.known[~mask].all()


def test_two_pictures_are_too_few():
    before, found, *_ = again([0] * 11 + [60] * 2, wrong=SOCK)
    _, once_more, *_ = again([0] * 10 + [60] * 3, wrong=SOCK)
    np.testing.assert_array_equal(found.mean[SOCK], before.mean[SOCK])
    assert (once_more.mean[SOCK] != before.mean[SOCK]).any()


def test_of_sixty_pictures_three_are_too_few():
    before, found, *_ = again([0] * 57 + [60] * 3, wrong=SOCK)
    np.testing.assert_array_equal(found.mean[SOCK], before.mean[SOCK])


@pytest.mark.parametrize("shade", [0.75, 0.42])
def test_a_shadow_that_falls_there_most_of_the_time_is_not_the_room(shade):
    """It falls beside the person: a few pictures without it tell."""
    shadow = np.roll(taken([0])[2], 30, axis=1) & ~taken([0])[2]
    _, found, empty, mask = again([0] * 10 + [80] * 3, shade, wrong=shadow)
    seen = shadow & ~np.roll(mask, 80, axis=1) & ~np.roll(mask, 110, axis=1)
    assert seen.sum() > 1000 and (off(found, empty)[seen] < 15).mean() > 0.95


def test_more_light_than_any_tracked_picture_shows_is_believed():
    before, found, *_ = again([0] * 8 + [60] * 5, toned=1.3)
    np.testing.assert_array_equal(found.mean[SOCK], before.mean[SOCK])


@pytest.mark.parametrize("toned", [0.7, (1.2, 1.35, 1.5)])
def test_shadows_and_lighter_colours_of_another_tint_give_way(toned):
    _, found, empty, _ = again([0] * 8 + [60] * 5, toned=toned)
    assert off(found, empty)[SOCK].max() < 12


@pytest.mark.parametrize("tint, lost", [(1.3, False), ((1.0, 1.2, 1.4), True)])
def test_a_person_lighter_than_the_room_is_no_light_in_it(tint, lost):
    """Nor where the track has lost them in a picture, if their colour is another one."""
    shown, empty, mask, *_ = taken([0] * 8 + [60] * 5)
    there = np.stack([np.roll(mask, place, axis=1) for place in [0] * 8 + [60] * 5])
    shown = np.where(there[..., None], np.clip(empty * tint, 0, 255), shown).astype(np.uint8)
    there[-1] &= not lost
    room = Learnt(empty.astype(np.float32), np.full(empty.shape, 2.0, np.float32))
    assert off(revised(room, shown, ~there), empty).max() < 12


def before(**changes):
    """The room of the demo, with a corner that is wrong and half of the floor unknown."""
    mean, spread = [plate.copy() for plate in PLATES.mean], [plate.copy() for plate in PLATES.spread]
    for view in mean:
        view[CORNER] = [20, 30, 220]
    for view in spread:
        view[300:, :160] = np.inf
    return Background(mean=tuple(mean), spread=tuple(spread), **changes)


def walked():
    """The track with a step to the side before its seventh frame."""
    step = 0.4 * (TRACK.frame >= 6)  # m
    root = TRACK.root.copy()
    root[:, 1, 3] += step
    return replace(TRACK, root=root)


def run(given, track=TRACK, recording=RECORDING, checks=None, first=LEARNT):
    return ReviseBackground().run(recording, SCENE, track, given, first, checks)


def test_the_stage_goes_by_the_track():
    given = before(floor_m=0.01)
    found = run(given)
    assert found.floor_m == 0.01
    body = SCENE.surface(TRACK.pose(0), TRACK.cloth_at(0))
    for camera, (mean, known) in enumerate(zip(found.mean, found.known, strict=True)):
        assert np.abs(mean - PLATES.mean[camera])[CORNER].max() < 16
        inside = covered(body, SCENE.cameras[camera])
        beside = distance_to(inside) > 20
        assert known[beside].mean() > 0.99
        core = distance_to(~inside) > 6  # covered in every frame: knees swing, the trunk does not
        core[250:] = False
        assert core.any()
        np.testing.assert_array_equal(mean[core], given.mean[camera][core])


def test_it_goes_by_each_frame():
    """The person walks on by a step: what was behind them is seen, but for where both places overlap."""
    track = walked()
    there = [covered(SCENE.surface(each.pose(11), each.cloth_at(11)), SCENE.cameras[1]) for each in (TRACK, track)]
    known = run(UNKNOWN, track).known[1]
    both, one = (distance_to(~place) > 6 for place in (there[0] & there[1], there[0] & ~there[1]))
    both[250:] = False  # knees swing
    assert both.any() and not known[both].any()
    assert one.sum() > 500 and known[one].mean() > 0.8


def test_clothes_are_the_persons():
    scene, root = demo_scene(clothed=True), TRACK.root[0]
    hanging = scene.garment.vertices @ root[:3, :3].T + root[:3, 3]
    track = replace(TRACK, cloth=np.tile(hanging, (12, 1, 1)))
    known = ReviseBackground().run(RECORDING, scene, track, UNKNOWN, LEARNT).known[0]
    surface = scene.surface(track.pose(0), track.cloth_at(0))
    beside_body = ~covered(scene.bare(surface), SCENE.cameras[0])
    cloth = covered(surface, SCENE.cameras[0]) & beside_body
    assert cloth.sum() > 500 and not known[cloth].any()


def test_few_pictures_are_those_of_the_run():
    given, later = before(), replace(TRACK, frame=TRACK.frame + 40)
    stage = ReviseBackground(samples=4)
    found = stage.run(open_recording(DEMO, start=40, stop=52), SCENE, later, given, LEARNT)
    assert np.abs(found.mean[0] - PLATES.mean[0])[CORNER].max() < 16


def test_clean_plates_stay_as_they_are():
    given = before()
    assert run(given, first=EmptyScene()) is given


def test_a_view_that_tells_nothing_stays_as_it_is():
    """No picture of it was used, its camera was knocked, or all of it is hidden."""
    given, usable = before(), TRACK.usable.copy()
    usable[2:, 1] = False
    knocks = Knocks(frame=np.array([4], np.int32), camera=np.array([2], np.int16), turn=np.eye(3)[None])
    checks = ViewChecks(frame=np.zeros(0, np.int32), camera=np.zeros(0, np.int16), reasons=(), knocks=knocks)
    views = list(RECORDING.views)
    views[3] = replace(views[3], occluder=np.ones(PLATES.mean[3].shape[:2], bool))
    found = run(given, replace(TRACK, usable=usable), replace(RECORDING, views=tuple(views)), checks)
    assert not np.array_equal(found.mean[0], given.mean[0])
    for camera in (1, 2, 3):
        np.testing.assert_array_equal(found.mean[camera], given.mean[camera])


@pytest.mark.parametrize("changes", [{"observed": np.zeros_like(TRACK.observed)}, {"doubted": TRACK.frame >= 0}])
def test_lost_and_doubted_frames_tell_nothing(changes):
    given = before()
    found = run(given, replace(TRACK, **changes))
    for old, new in zip(given.mean, found.mean, strict=True):
        np.testing.assert_array_equal(old, new)
