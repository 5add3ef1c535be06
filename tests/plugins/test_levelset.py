"""The segmenters levelset and grabcut as components."""

from dataclasses import replace

import numpy as np
import pytest
from levelset_scenes import ellipse
from mocapflow_levelset.background import BackgroundDifference
from mocapflow_levelset.evidence import Room
from mocapflow_levelset.evolve import Schedule
from mocapflow_levelset.grabcut import GrabCut
from mocapflow_levelset.layered import Layered
from mocapflow_levelset.layers import COLOURS
from mocapflow_levelset.levelset import LevelSet
from mocapflow_levelset.masks import counted, without_cut
from mocapflow_levelset.moved import moved_outline
from mocapflow_levelset.plates import Shadow, plate_of
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.view import Contact, Matte, View, _refined, find

from mocapflow.data import Change, Moment, Past, Turn
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import model_distance, occluding_contour
from mocapflow.model import moved
from mocapflow.testing import pictures, scenes

FIRST, LATER = Turn(index=0), Turn(index=1)


@pytest.fixture(scope="module")
def scene():
    return scenes.tiny_scene()


@pytest.fixture(scope="module")
def pose(scene):
    return scenes.tiny_pose(scene, 3, 0.1)


def believed(pose):
    return moved(pose, np.full(6 + len(pose.angles), 0.01))


def overlaps(found, scene, pose):
    masks = pictures.tiny_masks(scene, pose)
    inside = [s.distance > 0 for s in found.silhouettes]
    return [(a & b).sum() / (a | b).sum() for a, b in zip(inside, masks, strict=True)]


@pytest.mark.parametrize("known", [True, False])
def test_it_corrects_the_predicted_outline(scene, pose, known):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))
    segmenter = LevelSet(use_background=known, shape_weight=0.01)
    found = segmenter.segment(frame, state, Past(), scene, FIRST)
    surface = scene.surface(state.estimate.pose, state.cloth)
    model = [model_distance(surface, camera, 12.0) > 0 for camera in scene.cameras]
    before = [(a & b).sum() / (a | b).sum() for a, b in zip(model, pictures.tiny_masks(scene, pose), strict=True)]
    after = overlaps(found, scene, pose)
    assert min(after) > 0.93
    assert np.mean(after) > np.mean(before) + 0.03


def test_where_nobody_knows_the_room_local_colours_tell(scene, pose):
    """As if there were no room."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))
    background = scene.background
    unknown = replace(background, spread=tuple(np.full_like(part, np.inf) for part in background.spread))
    segmenter = LevelSet(decorrelate=False, matte_px=0)
    unused = segmenter.model_copy(update={"use_background": False})
    found, without, left_out, with_room = (
        each.segment(frame, state, Past(), scene.with_background(room), FIRST).of("person")
        for each, room in ((segmenter, unknown), (segmenter, None), (unused, background), (segmenter, background))
    )
    for one, *others, known in zip(found, without, left_out, with_room, strict=True):
        assert all((one.distance == other.distance).all() for other in others)
        assert (one.distance != known.distance).any()


def test_the_matte_moves_nothing_where_nobody_knows_the_room(scene, pose):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    background = scene.background
    unknown = replace(background, spread=tuple(np.full_like(part, np.inf) for part in background.spread))
    brighter = replace(unknown, mean=tuple(part + 20 for part in background.mean))
    found, same = (
        LevelSet().segment(frame, state, Past(), scene.with_background(room), FIRST).of("person")
        for room in (unknown, brighter)
    )
    for one, other in zip(found, same, strict=True):
        np.testing.assert_array_equal(one.distance, other.distance)


def test_later_turns_start_from_the_last_silhouettes(scene, pose):
    """A warm start with few steps stays at the solution although the model is off."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))
    segmenter = LevelSet(shape_weight=0.01)
    first = segmenter.segment(frame, state, Past(), scene, FIRST)
    second = segmenter.segment(frame, replace(state, segmentation=first), Past(), scene, LATER)
    assert np.mean(overlaps(second, scene, pose)) > np.mean(overlaps(first, scene, pose)) - 0.01


def test_silhouettes_stay_while_the_model_rests(scene, pose):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))

    state = replace(state, segmentation=LevelSet().segment(frame, state, Past(), scene, FIRST))

    def again(segmenter, shift, index=1, far=False):
        turn = replace(shifted(scene, state, shift, index), far=far)
        segmentation = segmenter.segment(frame, state, past, scene, turn)
        return segmentation is state.segmentation

    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=state.cloth),))
    assert again(LevelSet(), 0.001) and not again(LevelSet(), 0.1) and not again(LevelSet(keep_px=0), 0.0)
    assert not again(LevelSet(), 0.001, far=True) and again(LevelSet(), 0.001, index=2, far=True)


def shifted(scene, state, shift, index=1, where=slice(None)):
    """A later turn after one that moved some vertices by a way (3), or all along x by a distance (m)."""
    ways = np.zeros_like(scene.surface(state.estimate.pose, state.cloth).vertices)
    ways[where] = shift if np.ndim(shift) else [shift, 0, 0]
    return replace(LATER, index=index, change=Change(body=0.1, cloth=0.1, angles=0.1, sigmas=1.0, shift=ways))


def test_the_contour_is_found_anew_only_where_the_model_has_moved(scene, pose):
    """A segmenter that would move the whole contour moves it near the lowest vertices, which alone have moved."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=state.cloth),))
    state = replace(state, segmentation=LevelSet(steps=1, shape_weight=5.0).segment(frame, state, past, scene, FIRST))
    height = scene.surface(pose, state.cloth).vertices[:, 2]
    turn = shifted(scene, state, 0.1, where=height < np.quantile(height, 0.02))
    part = LevelSet(margin_px=20).segment(frame, state, past, scene, turn)
    whole = LevelSet(margin_px=20).segment(frame, state, past, scene, LATER)
    old, new, all_new = (segmentation.silhouettes[0].distance for segmentation in (state.segmentation, part, whole))
    changed, due = np.abs(new - old) > 0, np.abs(all_new - old) > 0.1
    rows = np.flatnonzero(changed.any(axis=1))
    assert due[: rows[0]].any() and not changed[: rows[0]].any()
    anew = np.abs(new - all_new)[rows[0] + 10 :][np.abs(all_new)[rows[0] + 10 :] < 1]
    assert anew.max() < 0.3


def test_a_view_in_which_no_outline_has_moved_keeps_its_silhouette_and_energies(scene, pose):
    """One that the person walks away from."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    state = replace(state, segmentation=LevelSet().segment(frame, state, Past(), scene, FIRST))
    away = 0.02 * scene.cameras[0].camera_from_world[2, :3]
    found = LevelSet().segment(frame, state, Past(), scene, shifted(scene, state, away))
    assert found.silhouettes[0] is state.segmentation.silhouettes[0]
    assert found.silhouettes[1] is not state.segmentation.silhouettes[1]
    assert found.energies["cam01.data"] == state.segmentation.energies["cam01.data"]
    assert found.energies["cam02.data"] != state.segmentation.energies["cam02.data"]


def test_a_view_without_a_picture_has_no_silhouette(scene, pose):
    frame = pictures.without_view(pictures.tiny_frame(scene, pose), 1)
    for segmenter in (LevelSet(), GrabCut(), BackgroundDifference()):
        found = segmenter.segment(frame, pictures.tiny_state(scene, pose), Past(), scene, FIRST)
        assert [silhouette.camera for silhouette in found.silhouettes] == [0, 2, 3]


def test_a_part_says_what_it_costs_more_than_the_start():
    """Of a disc that begins 4 px too far right the left half is found anew: that alone costs less than before."""
    rows, columns = np.mgrid[:160, :160]
    exact = (40.3 - np.hypot(columns - 80.4, rows - 79.7)).astype(np.float32)
    image = np.where((exact > 0)[..., None], [60, 90, 150], [140, 130, 120])
    image = np.clip(image + np.random.default_rng(0).normal(0, 3, image.shape), 0, 255).astype(np.uint8)
    segmenter, start = LevelSet(shape_weight=0.0, margin_px=24), redistance(np.roll(exact, 4, axis=1), 12.0)
    moved = np.zeros(start.shape, bool)
    moved[60:100, 44] = True
    resolutions, method, view = (
        segmenter._resolutions(warm=False),
        segmenter._method(),
        View(image, start, start, counted(start.shape, 3)),
    )
    part, whole = (find(each, resolutions, method) for each in (view._replace(moved=moved), view))
    left = (slice(60, 100), slice(36, 52))
    np.testing.assert_allclose(part.level[left], whole.level[left], atol=0.3)
    np.testing.assert_array_equal(part.level[:, 80:], start[:, 80:])
    gained = (start[left] > 0) != (part.level[left] > 0)
    assert gained.sum() > 100
    assert part.costs.data < -gained.sum()  # each by a log ratio well above 1
    nothing = find(view._replace(start=part.level, moved=moved), resolutions, method)
    assert abs(nothing.costs.data) < 0.1 * abs(part.costs.data)


def test_a_part_without_energies_of_before_has_none(scene, pose):
    """Another segmenter may have made the silhouettes of the turn before."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=state.cloth),))
    found = LevelSet().segment(frame, state, past, scene, shifted(scene, state, 0.2))
    assert np.isnan(found.energies["cam01.data"])


def test_a_person_who_has_left_the_view_is_looked_for_anew(scene, pose):
    away = moved(pose, np.concatenate([[0, 0, 0, 0, 0, 40.0], np.zeros(len(pose.angles))]))
    state = pictures.tiny_state(scene, away, pose)
    turn = shifted(scene, state, [0, 0, 40.0])
    surface = scene.surface(state.estimate.pose, state.cloth)
    assert moved_outline(surface, turn.change, scene.cameras[0], 2.0) is None


def test_an_outline_that_slides_along_itself_has_not_moved(scene, pose):
    state, camera = pictures.tiny_state(scene, pose), scene.cameras[0]
    surface = scene.surface(pose, state.cloth)
    outline = occluding_contour(surface, camera, 4.0)
    across = camera.camera_from_world[0, :3]  # x of the image
    x, y = np.rint(project(surface.vertices[outline.vertex], camera)).astype(int).T
    moved = moved_outline(surface, shifted(scene, state, 0.02 * across).change, camera, 1.0)[y, x]
    upright, flat = np.abs(outline.normal[:, 0]) > 0.9, np.abs(outline.normal[:, 0]) < 0.3
    x, y = np.rint(project(surface.vertices[outline.vertex] - 0.02 * across, camera)).astype(int).T
    shown = moved_outline(surface, shifted(scene, state, 0.02 * across).change, camera, 1.0)
    assert shown[y, x][upright].all()  # where it was before
    assert upright.sum() > 10 and moved[upright].all() and flat.sum() > 2 and not moved[flat].any()
    assert moved_outline(surface, Change(body=1, cloth=1, angles=1, sigmas=1), camera, 2.0) is None
    entered = moved_outline(surface, shifted(scene, state, 1.5 * across).change, camera, 1.0)
    assert entered.any() and not entered[:, 240:].any()  # it was beyond the left border


def test_energies_are_named_by_view_and_term(scene, pose):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    energies = LevelSet().segment(frame, state, Past(), scene, FIRST).energies
    assert {"cam01.data", "cam01.length", "cam01.shape", "cam04.data"} <= set(energies)
    assert np.isfinite(list(energies.values())).all()
    assert energies["cam01.length"] > 0 and energies["cam01.data"] < 0


def test_a_person_outside_a_view_gives_an_empty_silhouette(scene, pose):
    away = moved(pose, np.concatenate([[0, 0, 0, 0, 0, 40.0], np.zeros(len(pose.angles))]))
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, away, pose)
    for segmenter in (LevelSet(), GrabCut()):
        found = segmenter.segment(frame, state, Past(), scene, FIRST)
        assert len(found.silhouettes) == len(scene.cameras)
        assert all((s.distance == -12).all() for s in found.silhouettes)
    assert (GrabCut().find(frame.images[0], np.full((240, 320), 12, np.float32)) > 0).all()  # and one who fills it


def test_a_view_in_which_nobody_was_begins_anew_from_the_model(scene, pose):
    away = moved(pose, np.concatenate([[0, 0, 0, 0, 0, 40.0], np.zeros(len(pose.angles))]))
    frame, past = pictures.tiny_frame(scene, pose), Past()
    empty = LevelSet().segment(frame, pictures.tiny_state(scene, away, pose), past, scene, FIRST)
    here = pictures.tiny_state(scene, pose)
    found = LevelSet().segment(frame, replace(here, segmentation=empty), past, scene, shifted(scene, here, 40.0))
    afresh = LevelSet().segment(frame, here, past, scene, FIRST)
    assert min(overlaps(found, scene, pose)) > 0.9
    assert all(
        np.array_equal(a.distance, b.distance) for a, b in zip(found.silhouettes, afresh.silhouettes, strict=True)
    )


def disc(x, y, radius, width):
    rows, columns = np.mgrid[:160, :width]
    return (radius - np.hypot(columns - x, rows - y)).astype(np.float32)


def disc_in_a_room(width=160):
    """A picture of a disc, where it is, and the empty room by how much it is shrunk."""
    rng, exact, empty = np.random.default_rng(0), disc(80.4, 79.7, 40.3, width), np.ones((160, width, 3), np.float32)
    empty *= (140, 130, 120)
    alpha = np.clip(exact / 1.6 + 0.5, 0, 1)[..., None]
    image = alpha * [60, 90, 150] + (1 - alpha) * empty + rng.normal(0, 3, empty.shape)
    plates = {factor: plate_of(empty, np.full_like(empty, 3), ("lab",), factor) for factor in (1, 2, 4)}
    rooms = {factor: Room(plate, np.ones(plate.spread.shape, bool), Shadow()) for factor, plate in plates.items()}
    return np.clip(image, 0, 255).astype(np.uint8), exact, empty, rooms


def test_the_contour_is_sub_pixel():
    """A disc drawn with soft edges at a place between pixels is found to 0.15 px in the mean."""
    image, exact, _, rooms = disc_in_a_room()
    start = redistance(np.roll(exact, 4, axis=1), 12.0)
    for known in (rooms, None):
        segmenter = LevelSet(shape_weight=0.0)
        view = View(image, start, start, counted(start.shape, 3), known)
        found = find(view, segmenter._resolutions(warm=False), segmenter._method()).level
        at = np.abs(found) < 0.7
        assert abs((found - exact)[at].mean()) < 0.15
        assert np.abs((found - exact)[at]).mean() < 0.35


def test_an_arm_of_the_model_that_lies_in_the_empty_room_is_given_up():
    """Far from the person: both sides of its contour show the room."""
    image, exact, _, rooms = disc_in_a_room(400)
    stray, segmenter = disc(340, 80, 12.0, 400), LevelSet()
    model = redistance(np.maximum(exact, stray), 12.0)
    view = View(image, model, model, counted(model.shape, 3), rooms)
    found = find(view, segmenter._resolutions(warm=True), segmenter._method()).level
    assert not (found[stray > 0] > 0).any()
    assert (found[exact > 3] > 0).all()


@pytest.mark.parametrize("kept", ["contact", "hidden", "unknown"])
def test_a_matte_moves_nothing_where_it_may_not(kept):
    """A contour that has ended 1 px too far out, at the right of it."""
    image, exact, empty, _ = disc_in_a_room()
    right = np.arange(160)[None] * np.ones((160, 1)) > 80
    segmenter, zone = LevelSet(), np.zeros(exact.shape, bool)
    still = Schedule(0, 4, 4)
    contact = Contact(right if kept == "contact" else zone, still, segmenter._window(12.0))
    view = View(
        image, exact + 1, exact + 1, counted(exact.shape, 3, right if kept == "hidden" else None), contact=contact,
        matte=Matte(empty, ~right if kept == "unknown" else ~zone, 2),
    )  # fmt: skip
    level = _refined(redistance(exact + np.float32(1), 7.0), view, segmenter._method())
    off = (level - exact)[np.abs(exact) < 0.5], right[np.abs(exact) < 0.5]
    assert np.median(np.abs(off[0][off[1]] - 1)) < 0.2 and np.median(np.abs(off[0][~off[1]])) < 0.2


def test_the_literal_chapter_runs(scene, pose):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))
    literal = LevelSet(
        channels=("grey",), use_background=False, decorrelate=False, coarse_steps=0, half_steps=0, cell_px=1,
        stride_px=1, steps=20, contact_steps=0, statistics_every=1, redistance_every=5, length_weight=0.5,
        variance_floor=0.02,
    )  # fmt: skip
    assert min(overlaps(literal.segment(frame, state, Past(), scene, FIRST), scene, pose)) > 0.85


def test_beyond_a_cut_nothing_counts(scene, pose):
    """Pixels nearest to the rim of a partial body are masked; those at its sides are not."""
    surface = scene.surface(pose, scenes.tiny_cloth(scene, pose))
    camera = scene.cameras[0]
    model = model_distance(surface, camera, 12.0)
    top = surface.vertices[:, 2] > np.quantile(surface.vertices[:, 2], 0.98)
    partial = replace(scene.body, cut=top[: len(scene.body.vertices)])
    weight = without_cut(counted(model.shape, 3), model, partial, surface, camera)
    first_row = np.flatnonzero((model > 0).any(axis=1))[0]
    column = int(np.median(np.flatnonzero(model[first_row] > 0)))
    assert first_row > 30 and not weight[[first_row - 6, first_row - 25], column].any()  # farther than the band, too
    below = np.flatnonzero((model > 0).any(axis=1))[-1]
    assert weight[(first_row + below) // 2].sum() > 0.9 * (weight.shape[1] - 6)
    view = LevelSet()._view(pictures.tiny_frame(scene, pose), surface, Past(), replace(scene, body=partial), 0, [])
    np.testing.assert_array_equal(view.counted, weight)
    assert (without_cut(counted(model.shape, 3), model, scene.body, surface, camera) > 0).sum() == 234 * 314
    behind = replace(camera, camera_from_world=camera.camera_from_world - 20 * np.outer(np.eye(4)[2], np.eye(4)[3]))
    assert (without_cut(counted(model.shape, 3), model, partial, surface, behind) > 0).sum() == 234 * 314


def test_grabcut_repeats_exactly(scene, pose):
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, believed(pose))
    one, two = (GrabCut().segment(frame, state, Past(), scene, FIRST) for _ in range(2))
    for a, b in zip(one.silhouettes, two.silhouettes, strict=True):
        np.testing.assert_array_equal(a.distance, b.distance)
    assert min(overlaps(one, scene, pose)) > 0.8


def test_the_start_may_touch_the_image_border():
    start = ellipse(x=10, y=20)
    image = np.random.default_rng(0).integers(0, 256, (160, 160, 3), dtype=np.uint8)
    segmenter = LevelSet()
    view = View(image, start, start, counted(start.shape, 3))
    found = find(view, segmenter._resolutions(warm=False), segmenter._method())
    assert np.isfinite(found.level).all() and found.level.shape == start.shape


def test_inner_contours_stay_only_while_the_body_rests(scene, pose):
    """A limb that moves before the trunk moves no outline."""
    frame, state = pictures.tiny_frame(scene, pose), pictures.tiny_state(scene, pose)
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=state.cloth),))
    state = replace(state, segmentation=Layered().segment(frame, state, past, scene, FIRST))
    turn = shifted(scene, state, 0.0, index=2)
    calm = replace(turn, change=replace(turn.change, body=0.004))
    learned = Layered().segment(frame, state, past, scene, replace(calm, index=1))  # the turn in which colours are
    assert COLOURS in learned.appearance
    state = replace(state, segmentation=learned)
    assert Layered().segment(frame, state, past, scene, calm) is state.segmentation
    renewed = Layered().segment(frame, state, past, scene, turn)
    assert renewed is not state.segmentation and renewed.silhouettes == state.segmentation.silhouettes
    assert renewed.appearance == learned.appearance
