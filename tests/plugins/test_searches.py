"""Where a search for a lost pose begins, what it measures by, and what it leaves as it was."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from mocapflow_recovery.disagreement import FLYING, HANGING
from mocapflow_recovery.placing import heading_between
from mocapflow_recovery.sampling import Plan, Spread, parts
from mocapflow_recovery.searches import Searches, half_turn

from mocapflow.data import Past, Pose
from mocapflow.geometry.kinematics import root_position
from mocapflow.testing import scenes

SCENE = scenes.tiny_scene()
COUNT = len(SCENE.body.twists)
LEG = parts(SCENE.body)[1]
FITTED, PREDICTED, BEFORE, LONG_AGO, SEEN = np.random.default_rng(0).uniform(0.1, 0.4, (5, COUNT))  # angles
OTHER = 9.0  # what all poses cost that no table names


class Told(NamedTuple):
    """Measures poses by a table of what angles cost, and writes down how it was asked."""

    table: list
    asked: list
    past: Past
    start: object = "given"
    cloth_weight: float = 0.5
    model = scenes.tiny_model(SCENE)

    def distances(self, poses, measure="distance"):
        self.asked.append((measure, self.start, self.cloth_weight))
        named = [[cost for angles, cost in self.table if (pose.angles == angles).all()] for pose in poses]
        return np.array([min([OTHER, *costs]) for costs in named])

    def mismatches(self, poses):
        return self.distances(poses, "area")


def found(way, *table, seen=SEEN, asked=None, fitted=FITTED, gain=0.1):
    """Return the angles that a search ends at whose samples are its beginnings themselves and what was seen."""
    plan = Plan(Spread(0.0, 0.0, 0.0), (1.0,), 1, np.atleast_2d(seen), 1)
    fit, predicted, before, long_ago = (Pose(root=np.eye(4), angles=a) for a in (fitted, PREDICTED, BEFORE, LONG_AGO))
    scorer = Told(list(table), [] if asked is None else asked, scenes.tiny_past(SCENE, long_ago, before))
    return way(Searches(scorer, plan, predicted, fit, gain), np.random.default_rng(0)).angles


near = partial(Searches.local, spread=1e-9)
wide = partial(Searches.wide, by_area=False, cloth_weight=FLYING)
leg_alone = partial(Searches.limbs_alone, limbs=[LEG])


def with_leg(angles, other):
    return np.where(np.isin(np.arange(COUNT), LEG), other, angles)


@pytest.mark.parametrize("angles", [FITTED, PREDICTED, BEFORE, SEEN], ids=["fitted", "predicted", "before", "seen"])
def test_a_wide_search_begins_at_the_best_pose_at_hand(angles) -> None:
    np.testing.assert_array_equal(found(wide, (angles, 1.0)), angles)


@pytest.mark.parametrize("angles", [FITTED, PREDICTED, BEFORE], ids=["fitted", "predicted", "before"])
def test_a_limb_alone_is_sampled_around_where_it_is_fitted_predicted_and_was(angles) -> None:
    foot = np.where(np.arange(COUNT) == LEG[-1], SEEN, np.nan)
    wanted = np.where(np.isnan(foot), with_leg(FITTED, angles), foot)
    np.testing.assert_array_equal(found(leg_alone, (wanted, 1.0), seen=foot), wanted)


def test_the_other_leg_stays_where_one_is_looked_for_alone() -> None:
    np.testing.assert_array_equal(found(leg_alone, (FITTED, 2.0), (with_leg(SEEN, FITTED), 1.0)), FITTED)


@pytest.mark.parametrize("way", [wide, leg_alone], ids=["wide", "leg alone"])
def test_a_joint_bent_beyond_its_limits_is_sampled_around_where_it_was_predicted(way) -> None:
    over, possible = (np.where(np.arange(COUNT) == LEG[0], a, FITTED) for a in (9.0, PREDICTED))
    np.testing.assert_array_equal(found(way, (over, 2.0), (possible, 1.0), fitted=over), possible)


def test_a_second_search_begins_at_the_frame_before() -> None:
    """Another pose is nearer to the person, but only from that one a leg as it was seen leads on."""
    right = with_leg(BEFORE, SEEN)
    angles = found(wide, (PREDICTED, 2.0), (BEFORE, 3.0), (right, 1.0), seen=with_leg(np.full(COUNT, np.nan), SEEN))
    np.testing.assert_array_equal(angles, right)


@pytest.mark.parametrize("by_area", [True, False])
def test_a_wide_search_measures_without_the_start_and_with_its_weight_of_cloth(by_area) -> None:
    asked = []
    found(partial(Searches.wide, by_area=by_area, cloth_weight=FLYING), asked=asked)
    assert {how[1:] for how in asked} == {(None, FLYING)}
    assert any(how[0] == "area" for how in asked) == by_area


def test_the_search_near_the_start_tries_nothing_that_was_merely_seen() -> None:
    np.testing.assert_array_equal(found(near, (PREDICTED, 1.0), (with_leg(PREDICTED, SEEN), 0.1)), PREDICTED)


@pytest.mark.parametrize("way", [wide, leg_alone, near], ids=["wide", "leg alone", "near"])
def test_what_need_not_have_moved_is_as_it_was_fitted_or_else_predicted(way) -> None:
    """A leg as it was seen fits a little better."""
    table = [(with_leg(angles, SEEN), OTHER - 0.1) for angles in (FITTED, PREDICTED, BEFORE)]
    np.testing.assert_array_equal(found(way, *table), FITTED)
    if way is wide:
        np.testing.assert_array_equal(found(way, (PREDICTED, 1.0), (with_leg(PREDICTED, SEEN), 0.99)), PREDICTED)


@pytest.mark.parametrize(("gain", "angles"), [(0.1, with_leg(FITTED, SEEN)), (0.01, SEEN)])
def test_a_leg_that_mends_less_than_its_share_stays_as_it_was_fitted(gain, angles) -> None:
    table = (SEEN, 1.0), (with_leg(FITTED, SEEN), 1.5), (with_leg(SEEN, FITTED), 8.5)
    np.testing.assert_array_equal(found(wide, *table, gain=gain), angles)


def test_somebody_turned_round_looks_the_other_way_where_they_stand() -> None:
    one = scenes.tiny_pose(SCENE, 3, 0.1)
    other, asked = half_turn(one, SCENE.body), []
    assert heading_between(one, other) == pytest.approx(np.pi)
    np.testing.assert_allclose(root_position(SCENE.body, other.root), root_position(SCENE.body, one.root), atol=1e-12)
    np.testing.assert_allclose(other.root[2, :3], one.root[2, :3], atol=1e-12)
    found(Searches.turned_round, asked=asked)
    assert {how[2] for how in asked} == {HANGING} and "area" in {how[0] for how in asked}
