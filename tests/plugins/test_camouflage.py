"""Feet that look like the floor are not matched."""

from dataclasses import replace

import numpy as np
import pytest
from matching_scenes import FIRST, FRAME, bent, seen
from mocapflow_matching.camouflage import FEET, with_feet, without_camouflaged
from mocapflow_matching.containment import Containment
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.inner_contours import InnerContours

from mocapflow.data import NO_CLOTH, Matches, Past, empty_matches
from mocapflow.geometry.cameras import project
from mocapflow.testing import tiny_pose, tiny_scene

SCENE = tiny_scene()
LEG = np.isin(SCENE.body.main_joint, [SCENE.body.joint("knee_l"), SCENE.body.joint("hip_l")])
PAST = Past(appearance=with_feet({"layers": np.ones((2, 3))}, LEG))


@pytest.fixture(scope="module")
def truth():
    return tiny_pose(SCENE)


@pytest.mark.parametrize("matcher", [ContourIcp(), Containment()], ids=["contour_icp", "containment"])
def test_pairs_of_what_looks_like_the_room_are_left_out(matcher, truth):
    surface, shown = SCENE.surface(bent(truth, 15, SCENE), NO_CLOTH), seen(SCENE.surface(truth, NO_CLOTH), SCENE)
    every = matcher.match(FRAME, shown, surface, Past(), SCENE, FIRST)
    kept = matcher.match(FRAME, shown, surface, PAST, SCENE, FIRST)
    leg = LEG[every.vertex]
    assert leg.any()
    for name in ("camera", "pixel", "direction", "vertex", "weight"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(every, name)[~leg])


def test_ends_of_parts_that_look_like_the_room_are_left_out(truth):
    surface, vertex = SCENE.surface(truth, NO_CLOTH), np.arange(len(LEG), dtype=np.int32)
    ends = Matches(
        camera=np.zeros(len(vertex), np.int16),
        pixel=project(surface.vertices, SCENE.cameras[0]),
        direction=np.tile([1.0, 0.0], (len(vertex), 1)),
        vertex=vertex,
        weight=np.ones(len(vertex)),
    )
    shown = replace(seen(surface, SCENE), inner=ends)
    every, kept = (InnerContours().match(FRAME, shown, surface, past, SCENE, FIRST) for past in (Past(), PAST))
    assert len(every.vertex) == len(LEG)
    np.testing.assert_array_equal(kept.vertex, np.flatnonzero(~LEG))


def test_what_was_known_of_appearances_stays():
    assert set(PAST.appearance) == {"layers", FEET}
    assert PAST.appearance[FEET].shape == (len(SCENE.body.vertices),)


def test_cloth_is_no_part_of_the_body(truth):
    clothed = tiny_scene(clothed=True)
    first_of_cloth = len(clothed.body.vertices)
    matches = replace(
        empty_matches(),
        camera=np.zeros(2, np.int16),
        pixel=np.zeros((2, 2)),
        direction=np.zeros((2, 2)),
        vertex=np.array([0, first_of_cloth], np.int32),
        weight=np.ones(2),
    )
    everything = Past(appearance=with_feet({}, np.ones(first_of_cloth, bool)))
    assert without_camouflaged(matches, everything).vertex.tolist() == [first_of_cloth]
    assert without_camouflaged(matches, Past()) is matches
