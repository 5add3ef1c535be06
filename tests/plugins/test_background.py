"""Difference to the empty scene, with shadows; and the stage that learns the empty scene."""

import numpy as np
import pytest
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.shadows import floor_around
from mocapflow_sequence.background import EmptyScene, temporal_median

from mocapflow.assets import Background
from mocapflow.data import Past, Turn
from mocapflow.errors import RecordingError
from mocapflow.geometry.cameras import project
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.testing import pictures, scenes
from tests.fixtures.recordings import number_of, ring, write_recording

FIRST = Turn(index=0, cap=8)
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


def test_without_a_background_it_says_what_to_do():
    scene = scenes.tiny_scene().with_background(None)
    pose = scenes.tiny_pose(scene)
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    with pytest.raises(RecordingError, match="stage 'background'"):
        BackgroundDifference().segment(frame, state, Past(), scene, FIRST)


def test_the_median_sees_through_someone_who_walks_by():
    rng = np.random.default_rng(0)
    pictures = np.repeat(room()[None], 15, axis=0)
    for k in range(15):
        pictures[k, 40:180, 15 * k : 15 * k + 40] = (30, 30, 200)
    pictures = np.clip(pictures + rng.normal(0, 3, pictures.shape), 0, 255).astype(np.uint8)
    mean, spread = temporal_median(pictures)
    assert np.abs(mean - room()).mean() < 1.5
    assert np.abs(mean - room()).max() < 8
    assert 2 < np.median(spread) < 5


def test_a_median_in_place_of_plates_is_no_secret(tmp_path, caplog):
    write_recording(tmp_path, frames=5, cameras=ring(names=("cam01",)))
    recording = open_recording(tmp_path)
    EmptyScene(source="median").run(recording)
    assert not caplog.messages
    EmptyScene().run(recording)
    assert [line.split(":")[0] for line in caplog.messages] == [f"no clean plates in {tmp_path / 'background'}"]


def test_the_stage_prefers_plates_and_can_do_without():
    recording = open_recording(shipped("examples", "data", "skirt_steps"))
    plates = EmptyScene().run(recording)
    median = EmptyScene(source="median", samples=7).run(recording)
    for plate, spread, learnt in zip(plates.mean, plates.spread, median.mean, strict=True):
        # the person never leaves their place, so there the median shows them; the room agrees
        assert (np.abs(plate - learnt) < 2 * spread).mean() > 0.7


@pytest.mark.parametrize("length", [5, 25, 26, 48, 49, 63])
def test_the_median_is_of_as_many_frames_as_stated_all_over_the_recording(tmp_path, monkeypatch, length):
    write_recording(tmp_path, frames=length, cameras=ring(names=("cam01",)))
    taken = []
    monkeypatch.setattr("mocapflow_sequence.background.temporal_median", lambda pictures: (taken.extend(pictures), 0))
    EmptyScene(samples=25).run(open_recording(tmp_path, stop=3))
    numbers = [number_of(picture) for picture in taken]
    assert len(set(numbers)) == len(numbers) == min(length, 25)
    assert max(numbers[0], length - 1 - numbers[-1], *np.diff(numbers)) <= 2 * max(length // 25, 1)


def test_wanted_plates_that_are_missing_are_an_error(tmp_path):
    import shutil

    clip = shipped("examples", "data", "skirt_steps")
    for part in ("cameras.toml", "videos"):
        copy = shutil.copytree if (clip / part).is_dir() else shutil.copy
        copy(clip / part, tmp_path / part)
    with pytest.raises(RecordingError, match="no clean plates"):
        EmptyScene(source="plates").run(open_recording(tmp_path))


def test_darker_clothes_of_the_rooms_colour_are_no_shadow_off_the_floor():
    """The same picture of a coat of the wall's chromaticity: a shadow if it may be one, else the person."""
    alpha = np.clip(person() / 1.5 + 0.5, 0, 1)[..., None]
    clean = alpha * 255 * (0.5 * (room() / 255) ** 2.2) ** (1 / 2.2) + (1 - alpha) * room()
    image = np.clip(clean + np.random.default_rng(0).normal(0, 3, clean.shape), 0, 255).astype(np.uint8)
    nowhere = np.full(SHAPE, -12, np.float32)  # no model that could fill the hole
    off_floor = BackgroundDifference().find(image, nowhere, np.zeros(SHAPE, bool), known(), 0)
    assert ((off_floor > 0) == (person() > 0)).mean() > 0.98
    assert (BackgroundDifference().find(image, nowhere, FLOOR, known(), 0) > 0).mean() < 0.05


def test_shadows_may_fall_around_the_feet_only():
    scene = scenes.tiny_scene()
    pose = scenes.tiny_pose(scene)
    surface = scene.surface(pose, scenes.tiny_cloth(scene, pose))
    for camera in scene.cameras:
        floor = floor_around(surface, camera, 1.0)
        feet = surface.vertices[surface.vertices[:, 2].argmin()]
        column, row = np.clip(np.rint(project(feet[None], camera)[0]).astype(int), 0, [319, 239])
        assert floor[row, column] == 1
        assert floor[:100].sum() == 0
