"""Tests of how often a doubt that stays is looked into."""

from dataclasses import replace

import numpy as np
import pytest
from mocapflow_recovery.search_history import HISTORY, history_of, with_search, without_history

from mocapflow.data import FrameResult, Past
from mocapflow.testing import pictures, scenes
from mocapflow.testing.recovery import settled

SCENE = scenes.tiny_scene()
POSE = scenes.tiny_pose(SCENE)
FITTED = settled(pictures.tiny_state(SCENE, POSE, POSE), SCENE)
OTHER = replace(FITTED, state=replace(FITTED.state))  # another state
COLOURS = {"colours": np.ones(3)}


def before(frame: int, appearance) -> Past:
    past = scenes.tiny_past(SCENE, POSE)
    return replace(past, moments=(replace(past.moments[0], time=(frame - 1) / 30),), appearance=appearance)


def searched(mismatches, found: FrameResult = FITTED, every: int = 4) -> list[int]:
    """Return the frames that are searched if each has such a mismatch (cm²), and they stay doubted."""
    appearance, frames = {}, []
    for frame, mismatch in enumerate(mismatches):
        past = before(frame, appearance)
        if history_of(past).due(mismatch, frame / 30, past, every):
            frames.append(frame)
            result = with_search(replace(found, doubted=True), FITTED, mismatch, past)
            appearance = result.state.segmentation.appearance
    return frames


def test_searches_in_vain_of_a_doubt_that_stays_grow_rare():
    frames = searched(np.random.default_rng(0).uniform(7000, 7200, 3000))
    assert frames[:7] == [0, 1, 2, 4, 8, 16, 30]
    assert max(np.diff(frames)) == 30 and len(frames) < 3000 / 30 + 8
    assert searched([7000.0] * 20, every=1) == list(range(20))


@pytest.mark.parametrize("later", [200.0, 8200.0])
def test_a_doubt_that_changes_is_looked_into_soon(later):
    """A limb is lost while a door is open, or the door is shut."""
    frames = searched([7000.0] * 101 + [later] * 20)
    assert frames[-4:] == [90, 104, 108, 112]


def test_searches_that_help_stay_as_frequent_though_the_fit_is_still_doubted():
    assert searched([400.0] * 40, OTHER) == [0, 1, 2, *range(4, 40, 4)]


def test_the_first_frame_after_a_gap_is_searched():
    assert history_of(Past(appearance={HISTORY: np.array([9.0, 400.0])})).due(400.0, 1 / 30, Past(), every=4)


def test_a_fit_that_is_not_doubted_ends_it_and_all_else_that_is_known_stays():
    past = before(5, {HISTORY: np.array([9.0, 400.0]), **COLOURS})
    known = without_history(FITTED, past).state.segmentation.appearance
    assert history_of(before(6, known)).searches == 0 and (known["colours"] == 1).all()
    assert without_history(FITTED, before(5, COLOURS)) is FITTED
    ended = with_search(replace(OTHER, doubted=False), FITTED, 400.0, past).state.segmentation.appearance
    assert history_of(before(6, ended)).searches == 0 and (ended["colours"] == 1).all()
