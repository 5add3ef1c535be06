"""A limb that is lost is seen to be lost, and found again, whatever shadows and colours there are."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from mocapflow_levelset.colours import BINS
from mocapflow_levelset.plates import plate_in
from mocapflow_priors.density import Density, write
from mocapflow_recovery.disagreement import FLYING, HANGING, chamfer_distance, floating_area, uncovered_areas
from mocapflow_recovery.leaps import leaping, without_overbent
from mocapflow_recovery.limb_search import KNOWN, UNKNOWN, LimbSearch
from mocapflow_recovery.sampling import Plan, Spread, parts, put_back, samples, search, seen_samples, without_idle_parts
from mocapflow_recovery.scoring import Fit, Mismatch, StartPose, mismatch_of
from mocapflow_recovery.search_history import HISTORY
from mocapflow_recovery.search_triggers import Trigger
from mocapflow_recovery.searches import Searches, half_turn
from mocapflow_recovery.trimaps import SmallRoom, _distance, small_rooms, trimaps

from mocapflow.data import NO_CLOTH, Frame, Past, Pose
from mocapflow.geometry.cameras import project, shrunk
from mocapflow.geometry.silhouettes import covered
from mocapflow.model import increment_between
from mocapflow.testing import pictures, recovery, scenes, template_body

SCENE = scenes.tiny_scene()
settled = partial(recovery.settled, scene=SCENE)
POSE = scenes.tiny_pose(SCENE, 3, 0.1)
FRAME = pictures.tiny_frame(SCENE, POSE)
ROOM = small_rooms(SCENE.background, SCENE.cameras)
SPREAD = Spread(np.radians(25), np.radians(8), 0.06)
FEW = {"samples": 10, "seen_samples": 0}
QUICK = LimbSearch(**FEW)  # where what a search finds does not matter, or is found in ten samples
PLAN = Plan(SPREAD, (1.0, 0.5, 0.25), 40, np.empty((0, len(POSE.angles))), 0)


def astray(angle: float) -> Pose:
    """The pose with the left leg spread."""
    change = np.zeros(len(POSE.angles))
    change[SCENE.body.screw_names.index("hip_l.abduction")] = angle
    return Pose(root=POSE.root, angles=POSE.angles + change)


def at(index: int, past: Past, every: int = 1) -> tuple[Frame, Past]:
    """Return the frame as if it were another one of a recording of 30 a second, after every so many of its frames."""
    count = len(past.moments)
    moments = [replace(m, time=(index - every * (count - k)) / 30) for k, m in enumerate(past.moments)]
    return replace(FRAME, index=index, time=index / 30), replace(past, moments=tuple(moments))


def at_the_pose(pose: Pose, parameters):
    """Settle at the right pose, wherever it begins."""
    return settled(pictures.tiny_state(SCENE, POSE, POSE))


def surface(pose: Pose):
    return SCENE.surface(pose, NO_CLOTH)


def seen(frame=FRAME):
    return trimaps(frame, surface(POSE), ROOM, 0.35)


def apart(pose: Pose, looked, cloth=HANGING) -> float:
    return chamfer_distance(surface(pose), surface(pose), looked, 0.2, cloth)


def test_a_small_camera_sees_the_same() -> None:
    points = surface(POSE).vertices[::50]
    for camera in SCENE.cameras:
        small = project(points, shrunk(camera, 4))
        np.testing.assert_allclose(4 * small + 1.5, project(points, camera), atol=1e-9)  # centres of 4 x 4 squares


def test_person_and_room_are_certain_where_the_truth_says_so() -> None:
    for view, truth in zip(seen(), pictures.tiny_masks(SCENE, POSE), strict=True):
        quarters = truth.reshape(120, 2, 160, 2)
        whole, part = quarters.all(axis=(1, 3)), quarters.any(axis=(1, 3))
        assert np.mean(part[view.person]) > 0.98
        assert np.mean(view.person[whole]) > 0.95
        assert np.mean(view.distance[~part] > 0) > 0.9


def test_a_shadow_is_neither() -> None:
    dark = replace(FRAME, images=tuple(image.copy() for image in FRAME.images))
    spot = np.zeros(FRAME.images[0].shape[:2], bool)
    spot[205:225, 20:60] = True  # on the floor beside the person
    shadowed = tuple(np.where(spot[..., None], (0.75 * image).astype(np.uint8), image) for image in dark.images)
    lit, dim = seen(), seen(replace(FRAME, images=shadowed))
    part = spot[::2, ::2]
    for before, after, _ in zip(lit, dim, SCENE.cameras, strict=True):
        assert np.mean(after.person[part]) < 0.05  # not the person
        assert np.mean(after.distance[part] == 0) > np.mean(before.distance[part] == 0) + 0.5  # nor surely the room
    nowhere = [np.ones(spot.shape, bool)] * len(shadowed)  # may there be a shadow, as other views tell
    frame = replace(FRAME, images=shadowed)
    for near, far in zip(dim, trimaps(frame, surface(POSE), ROOM, 9.0, None, nowhere), strict=True):
        assert np.mean(far.person[part]) > 0.8 > np.mean(near.person[part])


def test_where_nobody_knows_the_room_it_is_neither() -> None:
    background = SCENE.background
    spread = tuple(part.copy() for part in background.spread)
    for part in spread:
        part[:, :160] = np.inf
    room = small_rooms(replace(background, spread=spread), SCENE.cameras)
    for view, _ in zip(trimaps(FRAME, surface(POSE), room, 0.35), SCENE.cameras, strict=True):
        assert not view.person[:, :80].any()
        assert not view.distance[:, :80].any()
        assert view.person[:, 80:].any()


def test_a_room_shrunk_by_more_than_it_is_wide_then_is_compared() -> None:
    """An image 320 wide is 11 wide if shrunk by 27, but 11 goes 29 times into 320."""
    plates = [plate_in(SCENE.background, number, ("lab",), 27) for number in range(len(SCENE.cameras))]
    room = [SmallRoom(shrunk(c, 27), 27, plate) for c, plate in zip(SCENE.cameras, plates, strict=True)]
    for view, _ in zip(trimaps(FRAME, surface(POSE), room, 0.35), SCENE.cameras, strict=True):
        assert view.person.shape == tuple(view.camera.size[::-1])


@pytest.mark.parametrize("room", [False, True], ids=["black", "like the room"])
def test_what_hides_the_person_is_neither(room) -> None:
    bar = np.zeros(FRAME.images[0].shape[:2], bool)
    bar[100:129] = True  # of the last two rows, which are one in a small view, the first
    shown = [mean.astype(np.uint8) if room else np.zeros_like(FRAME.images[0]) for mean in SCENE.background.mean]
    images = tuple(np.where(bar[..., None], *pair) for pair in zip(shown, FRAME.images, strict=True))
    for view, _ in zip(seen(replace(FRAME, images=images, hidden=(bar,) * len(images))), SCENE.cameras, strict=True):
        assert not view.person[50:65].any()
        assert not view.distance[50:65].any()


def test_a_gap_in_the_person_that_looks_like_the_room_is_the_person_s() -> None:
    person = np.ones((20, 30), bool)
    person[:, 10:13] = person[:, 20:] = False
    distance = _distance(~person, person)
    assert not distance[:, :20].any() and distance[10, 25] == pytest.approx(6, abs=0.5)


def test_somebody_far_away_is_not_the_person() -> None:
    other = tuple(image.copy() for image in FRAME.images)
    for image in other:
        image[60:200, 5:30] = 240
    for view, _ in zip(seen(replace(FRAME, images=other)), SCENE.cameras, strict=True):
        assert not view.person[30:100, 3:15].any()


@pytest.mark.parametrize("angle", [0.4, 0.8])
def test_a_leg_astray_counts_by_its_area_and_by_its_way(angle) -> None:
    wrong = surface(astray(angle))
    assert uncovered_areas(surface(POSE), seen(), [0.06], 0.2)[0, 0] < 20e-4
    assert uncovered_areas(wrong, seen(), [0.06], 0.2)[0, 0] > 150e-4
    assert floating_area(surface(POSE), seen(), 0.06) < 20e-4
    assert 150e-4 < floating_area(wrong, seen(), 0.06) < 0.25  # m², the skin of a leg
    ways = [apart(astray(part * angle), seen()) for part in (0, 0.5, 1)]
    assert ways == sorted(ways)
    assert ways[2] > 3 * ways[0]


@pytest.mark.parametrize(("told", "lost"), [(4.0, False), (-4.0, True)], ids=["the garment's", "a limb's"])
def test_what_shows_the_colours_of_the_garment_is_told_from_a_limb(told, lost) -> None:
    looked = trimaps(FRAME, surface(POSE), ROOM, 0.35, np.full(BINS, told))
    (skin, cloth), (near, _) = uncovered_areas(surface(astray(0.8)), looked, [0.06, 0.03], 0.2)
    assert near > skin if lost else near == 0
    assert (skin > 150e-4 and cloth == 0) if lost else (skin == 0 and cloth > 150e-4)
    assert all((view.cloth == (view.person & (told > 0))).all() for view in looked)


def test_a_skirt_that_flies_leads_no_limb_astray() -> None:
    """Cloth where a spread leg would be brings that leg no nearer to the person, though it would explain it."""
    flying = []
    for view in seen():
        flown = covered(surface(astray(0.8)), view.camera) & ~view.person
        distance = np.where(flown, 0, view.distance)
        flying.append(view._replace(person=view.person | flown, cloth=flown, distance=distance))
    assert apart(astray(0.8), flying, FLYING) > 2 * apart(POSE, flying, FLYING)
    assert apart(astray(0.8), flying, HANGING) < 1.1 * apart(POSE, flying, HANGING)  # as cloth that hangs it might


def test_a_skirt_that_flies_where_the_model_hangs_leads_no_limb_astray() -> None:
    """What the model has where nobody is counts less where it is cloth; skin counts fully, whatever cloth does."""
    skin, low = surface(POSE), surface(astray(0.8))  # as if a hem hung where the leg is astray
    hangs, flies = (chamfer_distance(low, skin, seen(), 0.2, cloth) for cloth in (HANGING, FLYING))
    assert flies < 0.8 * hangs
    assert chamfer_distance(low, low, seen(), 0.2, FLYING) == pytest.approx(hangs)


@pytest.mark.parametrize(("clothed", "given", "doubtful", "near", "far"), [
    (True, False, True, 0, [HANGING, FLYING]), (False, False, True, 0, [HANGING]),
    (True, False, False, 0, [HANGING, FLYING]),
    (True, True, False, 1, []), (True, True, True, 2, [HANGING, HANGING]),
])  # fmt: skip
def test_it_is_searched_as_if_cloth_hung_and_as_if_it_flew(clothed, given, doubtful, near, far) -> None:
    scorer = SimpleNamespace(start=given, model=SimpleNamespace(clothed=clothed))
    searches = Searches(scorer, PLAN, POSE, POSE, 0.1)
    ways = LimbSearch()._strategies(searches, Trigger("lost", doubtful, ()))
    weights = [way.keywords["cloth_weight"] for way in ways if "cloth_weight" in way.keywords]
    assert (len(ways) - len(weights), weights) == (near, far)


def test_a_limb_that_is_odd_is_looked_for_alone() -> None:
    def apart_from_truth(poses):
        return np.array([np.abs(pose.angles - POSE.angles).sum() for pose in poses])

    fitted, leg = Pose(root=POSE.root, angles=POSE.angles + 0.3), parts(SCENE.body)[1]
    model, past = SimpleNamespace(scene=SCENE), scenes.tiny_past(SCENE, fitted)
    scorer = SimpleNamespace(start=None, distances=apart_from_truth, model=model, past=past)
    searches = Searches(scorer, PLAN, fitted, fitted, 0.01)
    (way,) = LimbSearch()._strategies(searches, Trigger("a joint is bent beyond its limits", False, (leg,)))
    change = np.abs(way(np.random.default_rng(0)).angles - POSE.angles)
    assert change[leg].mean() < 0.25
    np.testing.assert_allclose(np.delete(change, leg), 0.3)


def test_parts_of_a_person() -> None:
    body = template_body()
    root, trunk, *limbs = parts(body)
    assert root is None
    first = {body.joint_names[body.screw_joint[limb[0]]] for limb in limbs}
    assert {"hip_l", "hip_r", "shoulder_l", "shoulder_r"} <= first
    assert {body.joint_names[joint] for joint in body.screw_joint[trunk]} >= {"spine", "chest"}
    together = np.concatenate([trunk, *limbs])
    assert sorted(together) == list(range(len(body.twists)))


def test_samples_differ_in_their_part_and_keep_the_limits() -> None:
    body, rng = SCENE.body, np.random.default_rng(0)
    part = parts(body)[1]
    for pose in samples(POSE, part, body, SPREAD, 4.0, 50, rng):
        assert ((pose.angles >= body.limits[:, 0]) & (pose.angles <= body.limits[:, 1])).all()
        np.testing.assert_array_equal(np.delete(pose.angles, part), np.delete(POSE.angles, part))
    centre = [pose.root[:3, :3] @ body.positions[0] + pose.root[:3, 3] for pose in
              samples(POSE, None, body, SPREAD, 1.0, 400, rng)]  # fmt: skip
    np.testing.assert_allclose(np.std(centre, axis=0), SPREAD.shift, rtol=0.15)  # the root turns about its joint


@pytest.mark.parametrize("part", [None, parts(SCENE.body)[1]], ids=["root", "leg"])
def test_samples_lie_as_far_off_as_their_spread_and_their_share_of_it(part) -> None:
    """A joint that rest holds hardly bends."""
    held, free = np.tile([-9.0, 9.0], (len(POSE.angles), 1)), SCENE.body.rest_spread.copy()
    free[1] = 0.02
    body = replace(SCENE.body, limits=held, rest_spread=free)
    far, near = (
        np.stack([increment_between(POSE, pose) for pose in samples(POSE, part, body, SPREAD, share, 400, rng)])
        for share, rng in ((1.0, np.random.default_rng(0)), (0.25, np.random.default_rng(0)))
    )
    np.testing.assert_allclose(near, 0.25 * far, atol=1e-9)
    if part is None:
        np.testing.assert_allclose(np.std(far[:, :3], axis=0), SPREAD.turn, rtol=0.15)
    else:
        first = far[:: len(set(body.screw_joint[part])), 6 + part]  # in which all of the leg moves
        expected = np.minimum(free[part], SPREAD.angle)
        np.testing.assert_allclose(np.std(first, axis=0), expected, rtol=0.2)


def test_search_finds_a_leg() -> None:
    def cost(poses):
        return np.array([apart(pose, seen_now) for pose in poses])

    seen_now = seen()
    found = search(cost, astray(0.8), SCENE.body, PLAN, np.random.default_rng(1))
    hip = SCENE.body.screw_names.index("hip_l.abduction")
    assert abs(found.angles[hip] - POSE.angles[hip]) < 0.1


def test_search_finds_nothing_worse_than_where_it_began() -> None:
    def cost(poses):
        return np.array([np.abs(pose.angles - POSE.angles).sum() for pose in poses])

    plan = PLAN._replace(seen=np.full((1, len(POSE.angles)), 0.5), seen_samples=1)
    assert search(cost, POSE, SCENE.body, plan, np.random.default_rng(0)) is POSE


def test_the_leg_that_fits_better_moves_first() -> None:
    """There is room for one of two; the one that is tried first fits less well."""
    body = template_body()
    first, second = parts(body)[2:4]

    def cost(poses):
        moved = np.array([[pose.angles[leg].any() for leg in (first, second)] for pose in poses])
        return 4 * moved.all(axis=1) - 2 * moved[:, 0] - 3 * moved[:, 1]

    still = Pose(root=POSE.root, angles=np.zeros(len(body.twists)))
    plan = Plan(Spread(0.0, 0.0, 0.0), (1.0,), 1, np.full((1, len(body.twists)), 0.1), 1)
    found = search(cost, still, body, plan, np.random.default_rng(0))
    assert found.angles[second].any() and not found.angles[first].any()


def test_what_fits_about_as_well_stays_as_it_was() -> None:
    body = template_body()
    first, second, third = parts(body)[2:5]

    def cost(poses):
        """Return what poses cost; half of the third limb where it was, half elsewhere, can't be."""
        angles = [pose.angles for pose in poses]
        return np.array([1.0 + 0.01 * a[first].any() + (not a[second].all()) + (0 < a[third].mean() < 0.099)
                         for a in angles])  # fmt: skip

    still = Pose(root=POSE.root, angles=np.zeros(len(body.twists)))
    found = put_back(cost, Pose(root=np.eye(4), angles=still.angles + 0.1), [still], body, 0.03)
    assert found.angles[second].all() and not np.delete(found.angles, second).any()
    assert found.root is POSE.root


def test_a_limb_is_also_sampled_from_each_further_joint_on() -> None:
    leg = parts(SCENE.body)[2]
    joint, rng = SCENE.body.screw_joint[leg], np.random.default_rng(0)
    tried = [pose.angles[leg] != POSE.angles[leg] for pose in samples(POSE, leg, SCENE.body, SPREAD, 1.0, 20, rng)]
    assert {int(joint[moved].min()) for moved in tried} == set(joint)


def test_a_leg_stays_where_an_arm_was_lost() -> None:
    """The leg takes the place of cloth that flies: it lies nearer to the person, but nothing of it was off."""
    body = template_body()
    leg, arm = (np.flatnonzero(body.screw_joint == body.joint(name)) for name in ("hip_l", "shoulder_r"))

    def mismatch(poses):
        return np.array([100.0 * (not p.angles[arm].any()) + 5.0 * (not p.angles[leg].any())
                         + 50.0 * (p.root is fitted.root) for p in poses])  # fmt: skip

    fitted = Pose(root=POSE.root, angles=np.zeros(len(body.twists)))
    found = Pose(root=np.eye(4), angles=fitted.angles + 0.1)
    kept = without_idle_parts(mismatch, found, fitted, body, 0.1)
    assert kept.angles[arm].all() and not kept.angles[leg].any() and kept.root is found.root
    assert without_idle_parts(mismatch, found, fitted, body, 0.01).angles[leg].all()
    nothing_off = without_idle_parts(lambda poses: np.zeros(len(poses)), found, fitted, body, 0.1)
    assert not nothing_off.angles.any()  # all parts are idle


def test_a_foot_does_not_turn_because_its_leg_was_found() -> None:
    """The foot as it was believed fits nearly as well; as it was fitted, with the leg astray, it does not."""
    body = template_body()
    hip, foot = (np.flatnonzero(body.screw_joint == body.joint(name)) for name in ("hip_l", "ankle_l"))

    def cost(poses):
        return np.array([1.0 + 0.01 * (p.angles[foot] > 0.05).any() + (p.angles[foot] < 0).any()
                         + (p.angles[hip] == 0).any() for p in poses])  # fmt: skip

    believed = Pose(root=POSE.root, angles=np.zeros(len(body.twists)))
    fitted = Pose(root=POSE.root, angles=np.where(np.isin(np.arange(len(body.twists)), foot), -0.5, 0.0))
    found = put_back(cost, Pose(root=POSE.root, angles=believed.angles + 0.1), [fitted, believed], body, 0.03)
    assert found.angles[hip].all() and not np.delete(found.angles, hip).any()


@pytest.mark.parametrize(
    ("index", "every", "vain", "looked"),
    [(8, 1, 3, True), (9, 1, 3, False), (9, 1, 2, True), (32, 4, 3, True), (36, 4, 3, False), (8, 1, 4, True),
     (12, 1, 4, False)],
    ids=["in turn", "not in turn", "new", "in turn, one frame of four", "not in turn, one frame of four",
         "in turn, waiting longer", "not in turn, waiting longer"],
)  # fmt: skip
@pytest.mark.long
def test_doubts_that_last_are_looked_into_now_and_then(index, every, vain, looked) -> None:
    """As where the room behind the person is not known rightly: the search takes as long as tens of frames."""
    calls = []

    def settle(pose, parameters):
        calls.append(pose)
        return settled(pictures.tiny_state(SCENE, POSE, POSE))

    search, model = LimbSearch(vain_every=4), scenes.tiny_model(SCENE)
    lost = pictures.tiny_state(SCENE, astray(0.9), POSE)
    frame, past = at(index, scenes.tiny_past(SCENE, POSE, POSE, POSE), every)
    area = mismatch_of(surface(astray(0.9)), SCENE, search.trimaps(frame, surface(astray(0.9)), past, SCENE)).area
    past = replace(past, appearance={HISTORY: np.array([vain, area])})
    found = search.recover(frame, lost, settled(lost), past, model, settle)
    assert bool(calls) == looked
    assert found.doubted != looked and ("not searched" in "".join(found.notes)) != looked
    left = {**past.appearance, **found.state.segmentation.appearance}[HISTORY]
    assert left[0] == (0 if looked else vain)


@pytest.mark.parametrize(("end", "doubted"), [(0.0, False), (0.9, True)], ids=["found", "still astray"])
def test_a_fit_that_still_strays_is_doubted(end, doubted) -> None:
    def settle(pose, parameters):
        return settled(pictures.tiny_state(SCENE, astray(end), POSE))

    lost = pictures.tiny_state(SCENE, astray(0.9), POSE)
    past, model = scenes.tiny_past(SCENE, POSE), scenes.tiny_model(SCENE)
    assert LimbSearch().recover(FRAME, lost, settled(lost), past, model, settle).doubted == doubted


@pytest.mark.parametrize(("rows", "little"), [(110, False), (140, True)], ids=["half", "little"])
def test_limbs_are_looked_for_where_the_room_is_known(rows, little, caplog) -> None:
    """And where little of it is known, that is told."""
    spread = tuple(part.copy() for part in SCENE.background.spread)
    for part in spread:
        part[:rows] = np.inf
    scene = SCENE.with_background(replace(SCENE.background, spread=spread))
    lost = pictures.tiny_state(SCENE, astray(0.9), POSE)
    small = small_rooms(scene.background, SCENE.cameras)
    assert (np.mean([view.known for view in trimaps(FRAME, surface(astray(0.9)), small, 0.35)]) < KNOWN) == little
    model = scenes.tiny_model(scene)
    found = QUICK.recover(FRAME, lost, settled(lost), scenes.tiny_past(SCENE, POSE), model, at_the_pose)
    assert "found again by search" in "".join(found.notes) and UNKNOWN not in caplog.text
    first = QUICK.recover(FRAME, lost, settled(lost), Past(), model, at_the_pose)
    assert (UNKNOWN in caplog.text) == little and "found again by search" in "".join(first.notes)


@pytest.mark.parametrize(
    ("past", "end", "times"),
    [(Past(), 0.9, 5), (Past(), 0.0, 1), (scenes.tiny_past(SCENE, POSE), 0.9, 1)],
    ids=["doubted", "not doubted", "a later frame"],
)
@pytest.mark.long
def test_a_first_frame_that_is_doubted_is_searched_twice_and_turned_round(past, end, times, caplog) -> None:
    begun, lost = [], pictures.tiny_state(SCENE, astray(end), POSE)

    def settle(pose, parameters):
        begun.append(pose)
        return settled(lost)  # nothing helps

    QUICK.recover(FRAME, lost, settled(lost), past, scenes.tiny_model(SCENE), settle)
    assert len(begun) == times and "looks the other way" not in caplog.text


@pytest.mark.long
def test_a_first_pose_that_looks_the_other_way_is_turned_round(caplog) -> None:
    change = np.zeros(len(POSE.angles))
    change[SCENE.body.screw_names.index("knee_l.flexion")] = 1.2  # of no other pose: no knee bends forward
    true = Pose(root=POSE.root, angles=POSE.angles + change)
    start = pictures.tiny_state(SCENE, half_turn(true, SCENE.body), true)

    def settle(pose, parameters):
        return settled(pictures.tiny_state(SCENE, pose, true))

    frame, model = pictures.tiny_frame(SCENE, true), scenes.tiny_model(SCENE)
    found = QUICK.recover(frame, start, settled(start), Past(), model, settle).state.estimate.pose
    assert "the first pose looks the other way" in caplog.text
    np.testing.assert_allclose(found.root[:3, :3], true.root[:3, :3], atol=0.2)


def test_a_doubt_that_is_cured_is_gain_enough() -> None:
    """A foot found again brings a whole person together by less than a tenth."""

    def settle(pose, parameters):
        return settled(pictures.tiny_state(SCENE, astray(0.25), POSE))

    lost, past = pictures.tiny_state(SCENE, astray(0.26), POSE), scenes.tiny_past(SCENE, POSE)
    uncovered = 1e4 * np.array(
        [uncovered_areas(surface(astray(end)), seen(), [0.06], 0.2)[0, 0] for end in (0.25, 0.26)]
    )
    assert uncovered[0] < uncovered[1]
    for line, cured in ((uncovered.mean(), True), (uncovered[0] / 2, False)):
        search = LimbSearch(**FEW, gain=0.9, uncovered_cm2=line, floating_cm2=1e6)
        found = search.recover(FRAME, lost, settled(lost), past, scenes.tiny_model(SCENE), settle)
        assert (found.state.estimate.pose is not lost.estimate.pose) == cured and found.doubted != cured


@pytest.mark.parametrize(
    ("past", "looked"),
    [(scenes.tiny_past(SCENE, POSE), False), (Past(after_gap=True), True), (Past(), True)],
    ids=["frame by frame", "after a gap", "first frame"],
)
def test_where_frames_begin_a_limb_is_looked_for_that_nothing_doubts(past, looked) -> None:
    near, model = pictures.tiny_state(SCENE, astray(0.06), POSE), scenes.tiny_model(SCENE)
    found = LimbSearch().recover(FRAME, near, settled(near), past, model, at_the_pose)
    assert (found.state.estimate.pose.angles == POSE.angles).all() == looked
    assert not found.doubted and bool(found.notes) == looked
    kept = LimbSearch(beginnings=False).recover(FRAME, near, settled(near), past, model, at_the_pose)
    assert kept.state.estimate.pose is near.estimate.pose and not kept.notes


@pytest.mark.parametrize(("hint", "looked"), [(inf, False), (1.0, True)])
def test_a_little_of_the_person_off_the_model_is_a_hint_where_it_counts(hint, looked) -> None:
    near, model = pictures.tiny_state(SCENE, astray(0.12), POSE), scenes.tiny_model(SCENE)
    search = LimbSearch(hint_cm2=hint, uncovered_cm2=1e4, floating_cm2=1e4)
    found = search.recover(FRAME, near, settled(near), scenes.tiny_past(SCENE, POSE), model, at_the_pose)
    assert (found.state.estimate.pose.angles == POSE.angles).all() == looked and not found.doubted
    assert looked == any("a little off the model: found again" in note for note in found.notes)


@pytest.mark.parametrize(("past", "found"), [(Past(), True), (Past(after_gap=True), False)], ids=["first", "gap"])
def test_a_first_frame_is_searched_near_the_pose_it_starts_from(past, found) -> None:
    """No sample reaches the leg where the fit has it; from the start it is near."""

    def settle(pose, parameters):
        return settled(pictures.tiny_state(SCENE, pose, POSE))

    start, lost = (pictures.tiny_state(SCENE, astray(angle), POSE) for angle in (0.25, 1.2))
    search = LimbSearch(spread_deg=1e-3, root_spread_deg=1e-3, root_spread_m=1e-6, seen_samples=0, uncovered_cm2=1e4,
                        floating_cm2=1e4)  # fmt: skip
    pose = search.recover(FRAME, start, settled(lost), past, scenes.tiny_model(SCENE), settle).state.estimate.pose
    assert (np.abs(pose.angles - POSE.angles).max() < 0.12) == found


@pytest.mark.parametrize(
    ("uncovered", "apart", "taken"),
    [(0.0, 1.9, True), (0.0, 2.1, False), (90.0, 1.9, False), (90.0, 0.8, True)],
    ids=["cured", "cured but far off", "as doubtful", "clearly nearer"],
)
def test_a_doubt_that_is_cured_may_cost_distance(uncovered, apart, taken) -> None:
    result = settled(pictures.tiny_state(SCENE, POSE, POSE))
    fit, other = (Fit(result, Mismatch(area, 0.0, 0.0, 0.0), far) for area, far in ((100.0, 1.0), (uncovered, apart)))
    assert (LimbSearch()._better(other, fit) is other) == taken


@pytest.mark.parametrize(
    ("left", "floating", "apart", "taken"),
    [(0.0, 0.0, 1.05, True), (0.0, 0.0, 1.15, False), (20.0, 0.0, 1.05, False), (0.0, 90.0, 1.05, False)],
    ids=["cleared", "cleared but farther", "still there", "cleared but doubted"],
)
def test_a_hint_that_is_cleared_may_cost_a_little_distance(left, floating, apart, taken) -> None:
    result = settled(pictures.tiny_state(SCENE, POSE, POSE))
    fit = Fit(result, Mismatch(0.0, 0.0, 0.0, 25.0), 1.0)
    other = Fit(result, Mismatch(0.0, floating, 0.0, left), apart)
    assert (LimbSearch(hint_cm2=15)._better(other, fit) is other) == taken


def test_of_what_searches_find_a_fit_that_is_not_doubted_comes_first() -> None:
    result = replace(settled(pictures.tiny_state(SCENE, POSE, POSE)), notes=("before",))
    sizes = (100.0, 1.0), (90.0, 0.5), (0.0, 0.8)
    fit, near, sound = (Fit(result, Mismatch(area, 0.0, 0.0, 0.0), apart) for area, apart in sizes)
    found = iter([near, sound])
    scorer = SimpleNamespace(
        start=None, model=SimpleNamespace(clothed=True), parameters=None, score=lambda _: next(found)
    )
    searches = SimpleNamespace(scorer=scorer, wide=lambda *_, **__: POSE)
    best = QUICK._searched(0, fit, searches, Trigger("lost", True, ()), lambda *_: result)
    assert not best.doubted and best.notes[0] == "before" and len(best.notes) == 2


@pytest.mark.parametrize(("past", "weight"), [(Past(), HANGING), (Past(after_gap=True), FLYING)])
def test_cloth_may_fly_once_its_colours_are_known(past, weight) -> None:
    result = settled(pictures.tiny_state(SCENE, POSE, POSE))
    assert QUICK._scorer(POSE, result, seen(), past, scenes.tiny_model(SCENE)).cloth_weight == weight


def test_of_two_fits_alike_the_one_nearer_to_the_start_is_taken() -> None:
    given = StartPose(astray(0.2), np.radians(6))
    others = np.array([given.penalty(astray(0.2 + angle)) for angle in (0.0, 0.1, 0.4)])
    assert others[0] == 1 and np.all(np.diff(others) > 0)
    assert given.penalty(Pose(root=POSE.root, angles=given.pose.angles + np.radians(6))) == pytest.approx(2)


def test_a_first_frame_that_is_right_says_nothing_of_the_search() -> None:
    right, model = pictures.tiny_state(SCENE, POSE, POSE), scenes.tiny_model(SCENE)
    found = LimbSearch().recover(FRAME, right, settled(right), Past(), model, lambda *_: settled(right))
    assert found.state.estimate.pose is right.estimate.pose and not found.notes


@pytest.mark.parametrize(
    ("believed", "seen_at", "leap"),
    [(0.0, 0.0, True), (0.0, 0.5, False), (0.5, 0.0, False), (0.0, np.nan, False)],
    ids=["far from both", "as somebody was seen", "as believed", "nobody was seen"],
)
def test_a_leap_ends_far_from_what_was_believed_and_from_what_was_seen(believed, seen_at, leap) -> None:
    names = ("hip_l.abduction",) if np.isfinite(seen_at) else ("elbow_l.flexion",)
    density = Density(names=names, poses=np.array([[astray(seen_at).angles[1]]]), bandwidth=0.1)
    found = leaping(astray(0.6), astray(believed), SCENE.body, density, 0.4)
    assert [part.tolist() for part in found] == ([parts(SCENE.body)[1].tolist()] if leap else [])


@pytest.mark.parametrize("found", [True, False])
def test_cloth_that_strays_calls_for_a_search_and_is_not_doubted(monkeypatch, found) -> None:
    """A raised knee holds a skirt before itself; or the skirt flies, and there is nothing to find."""
    monkeypatch.setattr("mocapflow_recovery.limb_search.garment_log_ratio", lambda *_: np.full(BINS, 4.0))
    lost, past = pictures.tiny_state(SCENE, astray(0.9), POSE), scenes.tiny_past(SCENE, POSE)
    end, search = POSE if found else astray(0.9), LimbSearch(floating_cm2=1e6)
    model = scenes.tiny_model(SCENE)
    result = search.recover(
        FRAME, lost, settled(lost), past, model, lambda *_: settled(pictures.tiny_state(SCENE, end, POSE))
    )
    assert (result.state.estimate.pose is POSE) == found
    assert bool(result.notes) == found and not result.doubted


@pytest.mark.parametrize(
    ("beyond", "index", "before", "looked"),
    [(0.07, 9, 1, False), (0.12, 9, 1, True), (0.12, 9, 3, False), (0.12, 8, 3, True)],
    ids=["a little", "new", "not in turn", "in turn"],
)
@pytest.mark.long
def test_a_joint_beyond_its_limits_is_looked_for_though_nothing_strays(beyond, index, before, looked) -> None:
    """5 degrees are 0.09: a limit is soft, and who is made so stays beyond it."""
    limits = SCENE.body.limits.copy()
    limits[1] = POSE.angles[1] - 1, POSE.angles[1] + 0.06 - beyond
    body, near = replace(SCENE.body, limits=limits), pictures.tiny_state(SCENE, astray(0.06), POSE)
    past, model = scenes.tiny_past(SCENE, *[astray(0.06)] * before), scenes.tiny_model(replace(SCENE, body=body))
    frame, past = at(index, past)
    found = LimbSearch().recover(frame, near, settled(near), past, model, at_the_pose)
    assert (found.state.estimate.pose.angles == POSE.angles).all() == looked
    assert bool(found.notes) == looked


def test_a_search_begins_within_the_limits() -> None:
    """No sample around an impossible foot reaches the right one."""
    body = replace(SCENE.body, limits=np.tile([-1.0, 1.0], (len(POSE.angles), 1)))
    other = Pose(root=POSE.root, angles=np.full(len(POSE.angles), 0.1))
    bent = Pose(root=2 * POSE.root, angles=np.where(np.arange(len(POSE.angles)) == 1, 1.2, 0.3))
    found = without_overbent(bent, other, body)
    assert found.root is bent.root
    assert found.angles[1] == 0.1 and (np.delete(found.angles, 1) == 0.3).all()


@pytest.mark.parametrize(("leap_deg", "looked"), [(2.0, True), (10.0, False), (np.inf, False)])
def test_a_limb_that_leapt_is_looked_for_though_nothing_strays(tmp_path, leap_deg, looked) -> None:
    seen_pose = Density(names=SCENE.body.screw_names, poses=POSE.angles[None], bandwidth=0.1)
    write(tmp_path / "seen.npz", seen_pose)
    search = LimbSearch(poses=tmp_path / "seen.npz", leap_deg=leap_deg)
    believed, near = (pictures.tiny_state(SCENE, pose, POSE) for pose in (POSE, astray(0.06)))  # by 3.4°
    past, model = scenes.tiny_past(SCENE, POSE), scenes.tiny_model(SCENE)
    found = search.recover(FRAME, believed, settled(near), past, model, at_the_pose)
    assert (found.state.estimate.pose.angles == POSE.angles).all() == looked
    assert not found.doubted and bool(found.notes) == looked


def test_seen_samples_bend_what_was_seen_and_nothing_else() -> None:
    leg = parts(SCENE.body)[2]
    seen_poses = np.full((5, len(POSE.angles)), np.nan)
    seen_poses[:, leg[0]] = np.linspace(0.1, 0.5, 5)
    plan = PLAN._replace(seen=seen_poses, seen_samples=3)
    tried = seen_samples(POSE, leg, SCENE.body, plan, np.random.default_rng(0))
    assert len({pose.angles[leg[0]] for pose in tried}) == 3
    assert all(pose.angles[leg[0]] in seen_poses[:, leg[0]] for pose in tried)
    assert all((np.delete(pose.angles, leg[0]) == np.delete(POSE.angles, leg[0])).all() for pose in tried)
    assert not seen_samples(POSE, parts(SCENE.body)[1], SCENE.body, plan, np.random.default_rng(0))
    stiff = replace(SCENE.body, limits=np.tile([-0.2, 0.2], (len(POSE.angles), 1)))
    tried = seen_samples(POSE, leg, stiff, plan._replace(seen_samples=9), np.random.default_rng(0))
    assert sorted(pose.angles[leg[0]] for pose in tried) == pytest.approx([0.1, 0.2, 0.2, 0.2, 0.2])  # each once


@pytest.mark.parametrize("left", [0, 8])
def test_a_view_in_which_something_stands_before_the_person_leads_nobody_astray(left) -> None:
    """Its picture shows the empty room, or a scrap of the person."""
    hidden = SCENE.background.mean[0].round().astype(np.uint8)
    row, column = np.argwhere(covered(surface(POSE), SCENE.cameras[0])).mean(axis=0).astype(int)
    scrap = np.s_[row : row + left, column : column + left]
    hidden[scrap] = FRAME.images[0][scrap]
    looked = seen(replace(FRAME, images=(hidden, *FRAME.images[1:])))
    assert len(looked) == len(seen()) and not looked[0].informative
    assert apart(POSE, looked) == pytest.approx(apart(POSE, seen()[1:]))
    assert apart(POSE, looked) < apart(astray(0.3), looked)


def test_where_no_picture_tells_person_from_room_a_fit_is_doubted() -> None:
    noise = np.random.default_rng(0).integers(0, 255, FRAME.images[0].shape, np.uint8)
    right, room = pictures.tiny_state(SCENE, POSE, POSE), replace(SCENE.background, floor_m=0.0)
    model, frame = scenes.tiny_model(SCENE.with_background(room)), replace(FRAME, images=(noise,) * len(FRAME.images))
    found = LimbSearch().recover(frame, right, settled(right), Past(), model, lambda *_: settled(right))
    assert found.doubted and "no picture tells" in found.notes[0]


def test_a_view_without_the_room_shows_nothing_surely() -> None:
    noise = np.random.default_rng(0).integers(0, 255, FRAME.images[0].shape, np.uint8)
    assert len(seen(replace(FRAME, images=(noise, *FRAME.images[1:])))) == len(seen()) - 1
