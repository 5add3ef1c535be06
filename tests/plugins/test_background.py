"""Difference to the empty scene, with shadows; and the stage that learns the empty scene."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned
from mocapflow_fitting.start_from_file import StartFromFile
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.plates import Shadow, plate_in
from mocapflow_levelset.shadows import colourless, floor_around
from mocapflow_sequence.background import EmptyScene
from mocapflow_sequence.colours import more_common
from mocapflow_sequence.dominant_colours import LEAST_SAME, dominant_colours
from mocapflow_sequence.first_frame import REACH_M, _about, empty_scene

from mocapflow.assets import Background
from mocapflow.caching.digests import Digests
from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Past, Turn
from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import project
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.running.recipes import steps_of
from mocapflow.scene import Scene
from mocapflow.testing import pictures, scenes
from tests.fixtures.patterned_room import STRIPES, taken
from tests.fixtures.recordings import number_of, ring, write_recording
from tests.fixtures.stores import PLUGIN, write_pipeline

FIRST = Turn(index=0)
SHAPE = (200, 240)
FLOOR = np.ones(SHAPE, bool)


def room():
    """Return a coloured, patterned floor (H, W, 3)."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    boards = 1 + 0.08 * np.sin(columns / 9)[..., None] + 0.05 * np.cos(rows / 17)[..., None]
    return np.array([120, 150, 175]) * boards


def person():
    """Return the signed distance to an upright ellipse between pixels."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return (1 - np.hypot((columns - 100.4) / 28, (rows - 95.3) / 70)) * 28


def shadowed(empty, factor):
    """Return the room in neutral light that is `factor` as strong in an ellipse at the person's feet."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    depth = np.clip(1.6 - np.hypot((columns - 150) / 50, (rows - 160) / 18), 0, 1)[..., None]
    linear = (empty / 255) ** 2.2 * (1 - (1 - factor) * depth)
    return 255 * linear ** (1 / 2.2)


def picture(factor, seed=0):
    empty = room()
    alpha = np.clip(person() / 1.5 + 0.5, 0, 1)[..., None]
    stripes = np.array([150, 70, 60]) * (1 + 0.25 * np.sin(np.arange(SHAPE[1]) / 3))[None, :, None]
    clean = alpha * stripes + (1 - alpha) * shadowed(empty, factor)
    noise = np.random.default_rng(seed).normal(0, 3, clean.shape)
    return np.clip(clean + noise, 0, 255).astype(np.uint8)


def known():
    empty = room().astype(np.float32)
    return Background(mean=(empty,), spread=(np.full_like(empty, 3.0),))


def model():
    return np.clip(person(), -12, 12).astype(np.float32)


@pytest.mark.parametrize("factor", [1.0, 0.6, 0.3])
def test_a_shadow_is_not_the_person(factor):
    distance = BackgroundDifference().find(picture(factor), model(), FLOOR, known(), 0)
    truth = person() > 0
    inside = distance > 0
    assert (inside & truth).sum() / (inside | truth).sum() > 0.97


def test_without_suppression_a_shadow_is_a_change():
    distance = BackgroundDifference(shadow_share=0.0).find(picture(0.3), model(), FLOOR, known(), 0)
    assert distance[160, 170] > 0


def test_the_boundary_is_sub_pixel():
    distance = BackgroundDifference().find(picture(1.0), model(), FLOOR, known(), 0)
    rows, columns = np.nonzero(np.abs(distance) < 0.7)
    from mocapflow_levelset.redistance import redistance

    exact = redistance(person().astype(np.float32), 12.0)
    error = (distance - exact)[rows, columns]
    assert abs(error.mean()) < 0.2
    assert np.sqrt((error**2).mean()) < 0.7


def test_someone_far_from_the_model_is_left_out():
    image = picture(1.0)
    image[20:60, 200:230] = (40, 200, 40)
    assert BackgroundDifference(reach_px=40).find(image, model(), FLOOR, known(), 0)[40, 215] < 0
    assert BackgroundDifference(reach_px=0).find(image, model(), FLOOR, known(), 0)[40, 215] > 0


def test_small_parts_holes_and_slits_are_noise_and_large_ones_where_the_model_has_none():
    changed, nowhere = person() > 0, np.full(SHAPE, -12, np.float32)
    small, large, slit, speck = np.s_[50:59, 90:99], np.s_[90:110, 90:110], np.s_[130:133], np.s_[10:15, 200:205]
    changed[small] = changed[large] = changed[slit] = False
    changed[speck] = True
    for given, filled in ((nowhere, False), (model(), True)):
        kept = BackgroundDifference(reach_px=0)._person(changed, given)
        assert kept[small].all() and kept[131, 85:115].all() and not kept[speck].any()
        assert kept[large].all() if filled else not kept[93:107, 93:107].any()


def test_where_nobody_knows_the_room_the_model_tells():
    """Half of the person, and much beside it, is before what nobody knows: there the model's outline is taken."""
    background = known()
    background.spread[0].flags.writeable = True
    background.spread[0][:, :101] = np.inf
    moved = np.roll(model(), -6, axis=1)  # off by 6 px
    plate = plate_in(background, 0, ("lab",))
    start = BackgroundDifference()._start(picture(1.0), moved, plate, FLOOR, Shadow(), None) > 0
    np.testing.assert_array_equal(start[:, :95], moved[:, :95] > 0)
    assert (start[:, 106:] == (person() > 0)[:, 106:]).mean() > 0.99


def test_without_a_background_it_says_what_to_do():
    scene = scenes.tiny_scene().with_background(None)
    pose = scenes.tiny_pose(scene)
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    with pytest.raises(RecordingError, match="stage 'background'"):
        BackgroundDifference().segment(frame, state, Past(), scene, FIRST)


def test_the_commonest_colour_sees_through_someone_who_walks_by():
    rng = np.random.default_rng(0)
    shown = np.repeat(room()[None], 15, axis=0)
    for k in range(15):
        shown[k, 40:180, 15 * k : 15 * k + 40] = (30, 30, 200)
    shown = np.clip(shown + rng.normal(0, 3, shown.shape), 0, 255).astype(np.uint8)
    mean, spread, share = dominant_colours(shown, 2)[0]
    assert np.abs(mean - room()).mean() < 1.5
    assert np.abs(mean - room()).max() < 8
    assert 2 < np.median(spread) < 5
    assert share[100, 60] < share[10, 10] == 1


def test_colours_are_those_that_most_pictures_agree_about():
    """Against counting them one by one."""
    rng = np.random.default_rng(1)
    shown = np.zeros((12, 40, 40, 3), np.uint8)  # most of it stands still, so there is no noise
    shown[:, :9, :8] = rng.choice(np.array([20, 90, 97, 200], np.uint8), (12, 9, 8, 1))
    first, second = dominant_colours(shown, 2)
    for y, x in np.ndindex(9, 8):
        values = shown[:, y, x, 0].astype(int)
        alike = np.abs(values[:, None] - values) <= LEAST_SAME
        best = int(alike.sum(axis=1).argmax())
        assert first.share[y, x] == pytest.approx(alike[best].mean())
        assert first.mean[y, x] == pytest.approx(values[alike[best]].mean())
        rest = values[~alike[best]]
        most = max(((np.abs(rest - value) <= LEAST_SAME).sum() for value in rest), default=0)
        assert second.share[y, x] == pytest.approx(most / 12)


def learnt(places, shade=1.0, move=None):
    shown, empty, mask, body, camera = taken(places, shade)
    if move is not None:
        body = replace(body, vertices=body.vertices + move)
    scene = empty_scene(shown, shown[0], body, camera)
    return scene.known, np.abs(scene.mean - empty).max(axis=2), mask


@pytest.mark.parametrize("move", [None, (0.02, 0.0, -0.02)])
def test_nobody_knows_what_is_behind_a_person_who_stays(move):
    known, off, mask = learnt([0] * 20, move=move)
    assert known[mask].mean() < 0.03
    assert known[~mask].mean() > 0.97
    assert off[known & ~mask].max() < 15


def test_a_view_that_the_person_is_not_in_is_all_room():
    """Beside the picture, and behind the camera, where nothing is so many pixels away."""
    camera = taken([0])[-1]
    for away_m in (20.0 * camera.camera_from_world[0, :3], -20.0 * camera.camera_from_world[2, :3]):
        known, _, _ = learnt([80] * 20, move=away_m)
        assert known.mean() > 0.97


def test_the_room_is_known_where_the_start_pose_is_off():
    """Most of what the body covers at the start pose is the room: what differs from it tells the person's colours."""
    known, off, mask = learnt([0, 25] * 10, move=(0.25, 0.0, 0.0))
    assert known[~mask].mean() > 0.97
    assert off[known & ~mask].max() < 30


def test_colours_that_are_rare_beside_the_person_say_nothing():
    usual, rare, on = 70_000, 10_000, 40_000  # bins far from each other
    beside = np.repeat(np.array([usual, rare], np.int32), [100_000, 20])
    common = more_common(beside, np.full(1000, on, np.int32))
    assert common[usual] and not common[rare] and not common[on]


def test_who_steps_aside_later_was_before_the_room():
    """In a third of the pictures the person stands elsewhere: then the room behind the first place is seen."""
    known, off, mask = learnt([0] * 14 + [60] * 7)
    assert known[mask].mean() > 0.9
    assert (off[known] < 15).mean() > 0.99


def test_who_comes_to_stand_elsewhere_is_not_the_room_there():
    """The most common colour there is the person's; the first frame shows the room."""
    known, off, mask = learnt([0] + [80] * 20)
    there = np.roll(mask, 80, axis=1)
    assert known[there].mean() > 0.97
    assert (off[known & there] < 15).mean() > 0.97


def test_a_limb_that_the_start_pose_has_elsewhere_is_not_the_room():
    """It is far from the body in that pose, and a few pictures later it is gone."""
    shown, empty, mask, body, camera = taken([0] * 20)
    limb = np.s_[130:190, 260:272]
    shown[:3][:, *limb] = STRIPES[limb]
    assert (_about(body, camera)[1][limb] > REACH_M).all()
    scene = empty_scene(shown, shown[0], body, camera)
    assert scene.known[limb].mean() > 0.97
    assert (np.abs(scene.mean - empty)[limb].max(axis=2) < 15).mean() > 0.97


@pytest.mark.parametrize("shade", [0.75, 0.42])
@pytest.mark.parametrize("places", [[0] + [80] * 20, [0] * 14 + [80] * 7])
def test_a_shadow_that_was_or_comes_is_not_the_room(places, shade):
    known, off, mask = learnt(places, shade)
    _, _, _, body, camera = taken([0])
    floor = floor_around(body, camera) & known & ~mask & ~np.roll(mask, 80, axis=1)
    for place in {*places}:
        shadow = floor & np.roll(mask, place + 30, axis=1)
        assert shadow.sum() > 200
        assert (off[shadow] < 15).mean() > 0.95


def test_a_room_without_plates_is_no_secret(tmp_path, caplog):
    write_recording(tmp_path, frames=5, cameras=ring(names=("cam01",)))
    recording, scene = open_recording(tmp_path), scenes.tiny_scene(cameras=1)
    EmptyScene(source="recording").run(recording, scene)
    assert not caplog.messages
    EmptyScene().run(recording, scene)
    assert [line.split(":")[0] for line in caplog.messages] == [f"no clean plates in {tmp_path / 'background'}"]


@pytest.mark.long
def test_the_stage_prefers_plates_and_can_do_without():
    """On the demo clip, whose person never leaves their place: what is known of the room is right."""
    clip = shipped("examples", "data", "skirt_steps")
    recording = open_recording(clip)
    scene = Scene(cameras=recording.cameras, body=Scanned().load(clip))
    start = StartFromFile().run(recording, scene)
    plates = EmptyScene().run(recording, scene, start)
    found = EmptyScene(source="recording").run(recording, scene, start)
    for plate, learnt, known in zip(plates.mean, found.mean, found.known, strict=True):
        assert 0.85 < known.mean() < 0.97
        ratio = (learnt[known] + 1) / (plate[known] + 1)
        shaded = (ratio.max(axis=1) < 1.15 * ratio.min(axis=1)) & (ratio.min(axis=1) > 0.4)
        same = np.abs(learnt - plate)[known].max(axis=1) < 16
        assert (same | shaded).mean() > 0.98  # the person covers a tenth


def test_the_frame_that_a_start_pose_is_compared_with_is_its_own(tmp_path):
    clip = write_recording(tmp_path / "clip", frames=6)
    stages = {"start": "tiny_start", "background": {"use": "background", "source": "recording"}}
    path = write_pipeline(tmp_path, clip, stages=stages, plugins=[str(PLUGIN)])
    steps = steps_of(load_pipeline(path, frames=slice(2, 5)), Digests())
    assert [step.recording.indices[0] for step in steps] == [2, 2]


@pytest.mark.parametrize("length", [5, 25, 26, 48, 49, 63])
def test_as_many_pictures_as_stated_from_all_over_the_recording(tmp_path, monkeypatch, length):
    write_recording(tmp_path, frames=length, cameras=ring(names=("cam01",)))
    seen = []
    monkeypatch.setattr(
        "mocapflow_sequence.background.dominant_colours",
        lambda pictures, *given: seen.extend(pictures) or dominant_colours(pictures, *given),
    )
    EmptyScene(samples=25).run(open_recording(tmp_path, stop=3), scenes.tiny_scene(cameras=1))
    numbers = [number_of(picture) for picture in seen]
    assert len(set(numbers)) == len(numbers) == min(length, 25)
    assert max(numbers[0], length - 1 - numbers[-1], *np.diff(numbers)) <= 2 * max(length // 25, 1)


def test_wanted_plates_that_are_missing_are_an_error(tmp_path):
    import shutil

    clip = shipped("examples", "data", "skirt_steps")
    for part in ("cameras.toml", "videos"):
        copy = shutil.copytree if (clip / part).is_dir() else shutil.copy
        copy(clip / part, tmp_path / part)
    with pytest.raises(RecordingError, match="no clean plates"):
        EmptyScene(source="plates").run(open_recording(tmp_path), scenes.tiny_scene())


def test_darker_clothes_of_the_rooms_colour_are_no_shadow_off_the_floor():
    """The same picture of a coat of the wall's chromaticity: a shadow if it may be one, else the person."""
    alpha = np.clip(person() / 1.5 + 0.5, 0, 1)[..., None]
    clean = alpha * 255 * (0.5 * (room() / 255) ** 2.2) ** (1 / 2.2) + (1 - alpha) * room()
    image = np.clip(clean + np.random.default_rng(0).normal(0, 3, clean.shape), 0, 255).astype(np.uint8)
    nowhere = np.full(SHAPE, -12, np.float32)  # no model that could fill the hole
    off_floor = BackgroundDifference().find(image, nowhere, np.zeros(SHAPE, bool), known(), 0)
    assert ((off_floor > 0) == (person() > 0)).mean() > 0.98
    assert (BackgroundDifference().find(image, nowhere, FLOOR, known(), 0) > 0).mean() < 0.05


@pytest.mark.parametrize(("light", "found"), [(0.3, True), (0.7, False)])
def test_without_colours_only_a_light_shadow_is_one(light, found):
    """Of a camera that sees no colours, dark legs before the floor are the person, as is a shadow as dark as they."""
    floor = np.repeat(room().mean(axis=2, keepdims=True), 3, axis=2)
    shape = np.clip(person() / 1.5 + 0.5, 0, 1)[..., None]
    noise = np.random.default_rng(0).normal(0, 3, (*SHAPE, 1))
    dark = floor * (1 - shape + shape * light ** (1 / 2.2))
    image = np.clip(dark + noise, 0, 255).astype(np.uint8)
    background = Background(mean=(floor.astype(np.float32),), spread=(np.full(floor.shape, 3, np.float32),))
    nowhere = np.full(SHAPE, -12, np.float32)
    share = (BackgroundDifference().find(image, nowhere, FLOOR, background, 0) > 0)[person() > 0].mean()
    assert share > 0.95 if found else share < 0.05
    told = BackgroundDifference(darkest_grey_shadow=0.5).find(image, nowhere, FLOOR, background, 0) > 0
    assert told[person() > 0].mean() < 0.05


def test_a_grey_room_may_be_seen_in_colour():
    """Then a shadow may be dark, for the person's skin tells that there are colours."""
    grey = np.full((*SHAPE, 3), 120, np.uint8)
    somebody = grey.copy()
    somebody[20:60, 80:110] = (90, 110, 170)
    background = Background(mean=(grey.astype(np.float32),), spread=(np.full(grey.shape, 3, np.float32),))
    segmenter = BackgroundDifference()
    darkest = {
        name: segmenter.shadow(image, background, 0).darkest
        for name, image in {"grey": grey, "coloured": somebody}.items()
    }
    assert darkest == {"grey": segmenter.darkest_grey_shadow, "coloured": segmenter.darkest_shadow}
    assert segmenter.shadow(grey, known(), 0).darkest == segmenter.darkest_shadow  # its room has colours


def test_a_camera_sees_colours_if_some_pixels_have_one():
    grey = np.full((400, 320, 3), 90, np.uint8) + np.arange(3, dtype=np.uint8)
    assert colourless(grey)
    grey[40:60, 40:60] = (120, 140, 180)  # a face
    assert not colourless(grey)


def test_shadows_may_fall_around_the_feet_only():
    scene = scenes.tiny_scene()
    pose = scenes.tiny_pose(scene)
    surface = scene.surface(pose, scenes.tiny_cloth(scene, pose))
    for camera in scene.cameras:
        floor = floor_around(surface, camera)
        feet = surface.vertices[surface.vertices[:, 2].argmin()]
        column, row = np.clip(np.rint(project(feet[None], camera)[0]).astype(int), 0, [319, 239])
        assert floor[row, column] == 1
        assert floor[:100].sum() == 0
