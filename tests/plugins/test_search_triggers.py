"""What triggers a search for limbs, and which are looked for."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_priors.density import Density
from mocapflow_recovery.limb_search import LimbSearch
from mocapflow_recovery.scoring import Mismatch
from mocapflow_recovery.search_triggers import OVERBENT, stay_overbent

from mocapflow.assets import Body
from mocapflow.data import NO_CLOTH, REMEMBERED, Moment, Past, Pose

CALM = Mismatch(uncovered=0.0, floating=0.0, cloth=0.0, hint=0.0)
SEARCH = LimbSearch(uncovered_cm2=100.0, floating_cm2=50.0, hint_cm2=30.0, leap_deg=28.0)


def standing(body: Body, bent: int | None = None) -> Pose:
    """A pose within its limits, or with one angle that is a degree farther beyond them than is put up with."""
    angles = np.clip(np.zeros(len(body.limits)), *body.limits.T)
    if bent is not None:
        angles[bent] = body.limits[bent, 1] + OVERBENT + np.radians(1)
    return Pose(root=np.eye(4), angles=angles)


def past_of(*poses: Pose) -> Past:
    return Past(moments=tuple(Moment(time=k / 30, pose=pose, cloth=NO_CLOTH) for k, pose in enumerate(poses)))


def triggered(body: Body, mismatch: Mismatch = CALM, fitted: Pose | None = None, past: Past | None = None):
    nothing_seen = Density(names=body.screw_names, poses=standing(body).angles[None], bandwidth=0.1)
    past = past_of(standing(body)) if past is None else past
    return SEARCH.trigger(mismatch, fitted or standing(body), standing(body), past, body, nothing_seen)


@pytest.mark.parametrize(
    ("mismatch", "reason", "doubtful"),
    [
        (dict(uncovered=101.0), "fit doubted, 101 cm² of the person uncovered", True),
        (dict(floating=51.0), "fit doubted, 0 cm² of the person uncovered, 51 cm² of skin in empty space", True),
        (dict(uncovered=60.0, cloth=41.0), "cloth off the model, 101 cm² of the person uncovered (41 of it", False),
        (dict(hint=31.0), "31 cm² of the person a little off the model", False),
    ],
)
def test_what_lies_apart_triggers_a_search_of_all_limbs(body, mismatch, reason, doubtful) -> None:
    found = triggered(body, CALM._replace(**mismatch))
    assert found.reason.startswith(reason) and found.doubtful is doubtful and not found.limbs
    less = {name: area - 2 for name, area in mismatch.items()}
    assert triggered(body, CALM._replace(**less)) is None


def test_a_beginning_triggers_a_search(body) -> None:
    assert triggered(body, past=Past()).reason == "looked for the limbs of a first frame"
    assert triggered(body) is None


def test_a_joint_beyond_its_limits_is_looked_for_alone(body) -> None:
    bent = int(np.flatnonzero(body.screw_joint == body.joint("knee_l"))[0])
    found = triggered(body, fitted=standing(body, bent))
    assert found.reason == "a joint is bent beyond its limits" and not found.doubtful
    assert all(bent in limb for limb in found.limbs) and found.limbs


def test_a_limb_that_leapt_is_looked_for_alone(body) -> None:
    screw = int(np.argmax(body.limits[:, 1]))  # that has room
    leapt = Pose(root=np.eye(4), angles=standing(body).angles + 0.6 * (np.arange(len(body.limits)) == screw))
    found = triggered(body, fitted=leapt)
    assert found.reason == "a limb leapt into a pose that nobody was seen in" and not found.doubtful
    assert all(screw in limb for limb in found.limbs) and found.limbs


def test_limbs_stay_overbent_where_all_frames_that_are_remembered_show_it(body) -> None:
    bent, straight = standing(body, int(np.flatnonzero(body.screw_joint == body.joint("knee_l"))[0])), standing(body)
    assert stay_overbent(past_of(*[bent] * REMEMBERED), body)
    assert not stay_overbent(past_of(*[bent] * (REMEMBERED - 1)), body)
    assert not stay_overbent(past_of(straight, *[bent] * (REMEMBERED - 1)), body)
