"""Islands of a silhouette: what the empty scene explains goes, what it does not stays."""

import numpy as np
import pytest
from levelset_scenes import ellipse
from mocapflow_levelset.evidence import Room, from_image, in_room
from mocapflow_levelset.islands import runs_of, without_islands
from mocapflow_levelset.plates import Shadow, plate_of

SHADOW = Shadow()


def evidence(image, known=True, unknown=np.s_[:0]):
    shape = image.shape[:2]
    seen = from_image(image, np.ones(shape, np.float32), ("lab",), 1)
    grey = np.full((*shape, 3), 120, np.float32)
    spread = np.full_like(grey, 3)
    spread[unknown] = np.inf
    room = Room(plate_of(grey, spread, ("lab",)), np.ones(shape, bool), SHADOW)
    return in_room(seen, image, ("lab",), room) if known else seen


def scene():
    """Return an image with a person and a hand in other colours than the room, and a level set with a stray island."""
    image = np.random.default_rng(0).normal(120, 3, (160, 160, 3)).clip(0, 255).astype(np.uint8)
    person, hand, stray = ellipse(60, 80, 25, 50), ellipse(120, 40, 10, 14), ellipse(120, 120, 10, 14)
    image[(person > 0) | (hand > 0)] = (40, 60, 180)
    return image, person, hand, stray


def test_only_the_island_in_the_empty_room_goes():
    image, person, hand, stray = scene()
    level = np.maximum(np.maximum(person, hand), stray)
    found = without_islands(level, evidence(image))
    np.testing.assert_array_equal(found > 0, (person > 0) | (hand > 0))
    np.testing.assert_array_equal(found[stray <= 0], level[stray <= 0])


def test_a_few_pixels_where_nobody_knows_the_room_keep_no_island():
    image, person, hand, stray = scene()
    level = np.maximum(np.maximum(person, hand), stray)
    found = without_islands(level, evidence(image, unknown=np.s_[118:120, 119:123]))
    np.testing.assert_array_equal(found > 0, (person > 0) | (hand > 0))


def test_all_stay_where_the_room_is_not_known_or_there_is_one_part():
    image, person, _, stray = scene()
    level = np.maximum(person, stray)
    assert without_islands(level, evidence(image, known=False)) is level
    assert without_islands(stray, evidence(image)) is stray  # a person lost altogether is no island


@pytest.mark.parametrize("cut", [np.s_[:, :120], np.s_[:120]], ids=["side", "foot"])
def test_a_limb_cut_off_by_a_crop_goes_if_it_shows_nothing_but_room(cut):
    image, person, hand, stray = scene()
    level = np.ascontiguousarray(np.maximum(np.maximum(person, hand), stray)[cut])
    found = without_islands(level, evidence(np.ascontiguousarray(image[cut])))
    np.testing.assert_array_equal((level > 0) & (found <= 0), stray[cut] > 0)


def test_runs_cover_a_mask():
    mask = np.random.default_rng(1).random((9, 13)) < 0.5
    painted = np.zeros_like(mask)
    for row, first, last in runs_of(mask):
        assert last > first
        painted[row, first:last] = True
    np.testing.assert_array_equal(painted, mask)
