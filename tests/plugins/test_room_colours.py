"""Colours of the person and of the room beside them: learned from earlier frames, they find a limb that has strayed."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_levelset.colours import BINS, bins_of
from mocapflow_levelset.layered import Layered
from mocapflow_levelset.layers import CLIP, COLOURS, layer_of
from mocapflow_levelset.room_colours import ROOM, person_log_ratio, room_histograms

from mocapflow.data import Frame, Past, Pose, Turn
from mocapflow.geometry.silhouettes import covered, intersection_over_union
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_scene, tiny_segmentation, tiny_state

SCENE = tiny_scene()
POSE = tiny_pose(SCENE, 1, 0.05)
SKIN, WALL, DOOR = (40, 80, 170), (60, 140, 60), (150, 140, 60)  # BGR
GRID, REACH = 2, 30


def silhouette(pose, camera):
    return covered(SCENE.surface(pose, tiny_cloth(SCENE, pose)), camera)


def pictures(pose):
    """The person before a wall with a door, a few grey levels of noise over both."""
    images, rng = [], np.random.default_rng(3)
    for camera in SCENE.cameras:
        person = silhouette(pose, camera)
        image = np.where(person[..., None], SKIN, WALL).astype(np.float64)
        image[:, : person.shape[1] // 2][~person[:, : person.shape[1] // 2]] = DOOR
        images.append(np.clip(image + rng.normal(0, 4, image.shape), 0, 255).astype(np.uint8))
    return Frame(index=1, time=0.0, images=tuple(images), usable=np.ones(len(images), bool))


def learned(frame, past=None):
    return room_histograms(frame, tiny_segmentation(SCENE, POSE).silhouettes, past or Past(), 0.9, GRID, REACH)


def past_of(frame):
    counts = np.zeros((layer_of(SCENE).max() + 1, BINS))
    counts[:, bins_of(np.array(SKIN, np.uint8))] = 500
    return Past(appearance={COLOURS: counts, ROOM: learned(frame)})


def strayed(degrees):
    angles = POSE.angles.copy()
    angles[SCENE.body.screw_names.index("knee_l.flexion")] += np.radians(degrees)
    return Pose(root=POSE.root, angles=angles)


def test_the_room_s_colours_are_those_beside_the_person():
    counts, skin = learned(pictures(POSE)), bins_of(np.array(SKIN, np.uint8))
    assert counts.shape == (len(SCENE.cameras), BINS)
    assert (counts.sum(axis=1) > 500).all()
    assert (counts[:, skin] < 0.02 * counts.sum(axis=1)).all()


def test_what_is_hidden_is_not_learned():
    frame = pictures(POSE)
    assert learned(replace(frame, hidden=tuple(np.ones(i.shape[:2], bool) for i in frame.images))).sum() == 0


def test_a_limb_beside_the_model_does_not_pass_for_the_room():
    past, skin = past_of(pictures(POSE)), bins_of(np.array(SKIN, np.uint8))
    before, after = past.appearance[ROOM], learned(pictures(strayed(60)), past)
    np.testing.assert_allclose(after[:, skin], 0.9 * before[:, skin])


def test_colours_tell_person_from_room_and_nothing_of_what_was_never_seen():
    ratio = person_log_ratio(past_of(pictures(POSE)), 0)
    skin, wall, never = (ratio[bins_of(np.array(colour, np.uint8))] for colour in (SKIN, WALL, (250, 250, 5)))
    assert skin > 2 and wall < -2
    assert never == pytest.approx(0, abs=0.01)
    assert np.abs(ratio).max() <= CLIP


def test_a_view_that_has_shown_no_room_tells_nothing():
    frame = pictures(POSE)
    first, second, third, _ = tiny_segmentation(SCENE, POSE).silhouettes
    nobody = replace(third, distance=np.full_like(third.distance, -12))
    shown = room_histograms(frame, [first, second, nobody], Past(), 0.9, GRID, REACH)
    appearance = past_of(frame).appearance | {ROOM: shown}
    assert not person_log_ratio(Past(appearance=appearance), 3).any()
    assert not person_log_ratio(Past(appearance=appearance), 2).any()
    assert person_log_ratio(Past(appearance=appearance), 1).any()


def test_before_a_frame_has_shown_the_room_nothing_is_told_and_then_it_is_learned():
    frame, state, segmenter = pictures(POSE), tiny_state(SCENE, POSE), Layered(use_background=False, colour_weight=1.0)
    found = segmenter.segment(frame, state, Past(), SCENE, Turn(index=0))
    plain = Layered(use_background=False).segment(frame, state, Past(), SCENE, Turn(index=0))
    for one, other in zip(found.silhouettes, plain.silhouettes, strict=True):
        np.testing.assert_array_equal(one.distance, other.distance)
    assert ROOM not in found.appearance
    assert ROOM in segmenter.segment(frame, state, Past(), SCENE, Turn(index=1)).appearance


def test_a_limb_that_came_back_elsewhere_is_found_by_its_colours():
    """The shank is believed 80° from where it is, before the wall: local statistics call the wall the person there."""
    frame, believed = pictures(POSE), strayed(80)
    state, past = tiny_state(SCENE, believed), past_of(frame)

    def overlap(weight):
        segmenter = Layered(use_background=False, colour_weight=weight, coarse_steps=8)  # with more, both arrive
        found = segmenter.segment(frame, state, past, SCENE, Turn(index=0))
        true = [silhouette(POSE, camera) for camera in SCENE.cameras]
        return np.array([intersection_over_union(s.distance > 0, true[s.camera]) for s in found.silhouettes])

    blind, told_apart = overlap(0.0), overlap(1.0)
    assert (told_apart >= blind).all()
    assert (1 - told_apart).mean() < 0.75 * (1 - blind).mean()
