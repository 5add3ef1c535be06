import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocapflow.assets import Body
from mocapflow.data import Pose
from mocapflow.geometry import angles, kinematics, twists
from mocapflow.geometry.skeleton import Skeleton, body_directions
from mocapflow.model import moved
from mocapflow.scene import Scene

DEMO = Path(__file__).parents[2] / "examples" / "data"


def stick_body(clip: str = "skirt_steps", keep: tuple[str, ...] = ()) -> Body:
    entries = json.loads((DEMO / clip / "subject" / "skeleton.json").read_text())["joints"]
    entries = [e for e in entries if not keep or e["name"].split("_")[0] in keep]
    names = [e["name"] for e in entries]
    positions = np.array([e["position"] for e in entries], np.float64)
    moving = np.repeat(np.arange(1, len(names)), 3)
    return Body(
        vertices=positions, faces=np.zeros((0, 3), np.int32), joint_names=tuple(names),
        parents=np.array([names.index(e["parent"]) if e["parent"] else -1 for e in entries], np.int32),
        positions=positions, screw_names=tuple(f"{names[j]}.{k}" for k, j in enumerate(moving)),
        twists=twists.screw(np.tile(np.eye(3), (len(names) - 1, 1)), positions[moving]),
        screw_joint=moving.astype(np.int32), limits=np.tile([-3.0, 3.0], (len(moving), 1)),
        rest_spread=np.full(len(moving), np.inf), skin_joint=np.zeros((len(names), 5), np.int32),
        skin_weight=np.tile([1.0, 0, 0, 0, 0], (len(names), 1)), cut=np.zeros(len(names), bool),
    )  # fmt: skip


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
def test_columns_and_three_point_angles_are_those_of_the_truth(clip: str) -> None:
    header, *lines = (DEMO / clip / "truth" / "angles.csv").read_text().splitlines()
    truth = np.array([line.split(",") for line in lines], np.float64)[:, 1:]
    joints = np.load(DEMO / clip / "truth" / "joints.npz")
    names = tuple(str(n) for n in joints["names"])
    wanted = angles.definitions(names)
    assert ["frame", *(d.name for d in wanted)] == header.split(",")
    for column, wish in enumerate(wanted):
        if len(wish.points) == 3:
            points = joints["positions"][:, [names.index(p) for p in wish.points]].astype(np.float64)
            assert np.abs(angles.three_point(points) + wish.offset - truth[:, column]).max() < 2e-3


def test_centres_of_three_joints_make_the_angle_between_them() -> None:
    shank, foot = np.array([0.0, 0.0, -0.4]), np.array([[0.2, 0.0, 0.0], [0.1, 0.0, -0.1]])  # flat, and pointed
    places = {"knee_l": np.zeros((2, 3)), "ankle_l": np.tile(shank, (2, 1)), "toe_l": shank + foot}
    found = angles.between_centres(places)
    assert list(found) == ["ankle_l"] and found["ankle_l"] == pytest.approx([0.0, -45.0])
    assert not angles.between_centres({"hip_l": shank, "knee_l": shank})  # hip flexion is of the pelvis, too


def test_what_is_not_measured_is_said() -> None:
    body = stick_body()
    assert angles.unmeasured(body.joint_names) == ""
    legs = stick_body(keep=("pelvis", "hip", "knee", "ankle", "toe"))
    said = "no angles elbow_l, elbow_r: the skeleton has no joints named shoulder_l, elbow_l, wrist_l, "
    assert angles.unmeasured(legs.joint_names) == said + "shoulder_r, elbow_r, wrist_r"
    assert Scene(cameras=(), body=body).warnings == ()
    assert Scene(cameras=(), body=legs).warnings == (f"body: {angles.unmeasured(legs.joint_names)}",)
    cut = np.ones(len(legs.cut), bool)  # as `part: legs` leaves it
    assert Scene(cameras=(), body=replace(legs, cut=cut)).warnings == ()
    named = tuple(name.replace("toe", "ball") for name in legs.joint_names)
    said = "body: no angles ankle_l, ankle_r: the skeleton has no joints named toe_l, toe_r"
    assert Scene(cameras=(), body=replace(legs, cut=cut, joint_names=named)).warnings == (said,)


@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
def test_hip_flexion_is_that_of_the_truth(clip: str) -> None:
    header, *lines = (DEMO / clip / "truth" / "angles.csv").read_text().splitlines()
    truth = np.array([line.split(",") for line in lines], np.float64)
    joints, body = np.load(DEMO / clip / "truth" / "joints.npz"), stick_body(clip)
    names, places = [str(n) for n in joints["names"]], joints["positions"].astype(np.float64)
    rigid = [names.index(n) for n in ("pelvis", "hip_l", "hip_r", "spine")]
    rest = body.positions[[body.joint(names[i]) for i in rigid]]
    for side in "lr":
        column = header.split(",").index(f"hip_flexion_{side}")
        for row in range(0, len(places), 7):
            u, _, vt = np.linalg.svd((places[row, rigid] - places[row, rigid].mean(0)).T @ (rest - rest.mean(0)))
            pelvis = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
            thigh = pelvis.T @ (places[row, names.index(f"knee_{side}")] - places[row, names.index(f"hip_{side}")])
            forward, up, _ = angles.anatomical_axes(body)
            assert abs(np.degrees(np.arctan2(thigh @ forward, -thigh @ up)) - truth[row, column]) < 0.02


@pytest.mark.parametrize("flexion", [-20.0, 0.0, 35.0, 110.0])
def test_a_thigh_that_swings_forward_flexes_the_hip_by_as_much(flexion: float) -> None:
    body = stick_body()
    forward, up, right = angles.anatomical_axes(body)
    assert (body.positions[body.joint("toe_l")] - body.positions[body.joint("ankle_l")]) @ forward > 0.05
    hip = int(np.flatnonzero(body.screw_joint == body.joint("hip_l"))[0])
    axes = body.twists[:, :3].copy()
    axes[hip] = right  # a turn about it takes what hangs down to the front
    body = replace(body, twists=twists.screw(axes, body.positions[body.screw_joint]))
    thigh, at = body.positions[body.joint("knee_l")] - body.positions[body.joint("hip_l")], np.zeros((1, len(axes)))
    at[0, hip] = np.radians(flexion)
    series = angles.measure(body, twists.exp(np.random.default_rng(1).normal(size=(1, 6))), at)
    rest = np.degrees(np.arctan2(thigh @ forward, -thigh @ up))
    assert series.value[0, series.names.index("hip_flexion_l")] == pytest.approx(rest + flexion)


def test_gradients_agree_with_finite_differences() -> None:
    body = stick_body()
    rng = np.random.default_rng(3)
    size = 6 + len(body.twists)
    pose = Pose(root=twists.exp(rng.normal(size=6)), angles=rng.normal(scale=0.4, size=size - 6))
    step = 1e-6
    ends = [moved(pose, sign * step * unit) for unit in np.eye(size) for sign in (1, -1)]
    value = angles.measure(body, np.stack([p.root for p in ends]), np.stack([p.angles for p in ends])).value
    numeric = np.radians(value[0::2] - value[1::2]) / (2 * step)  # (S, A)
    root, at = pose.root[None], pose.angles[None]
    centres = dict(zip(body.joint_names, np.swapaxes(kinematics.joint_centres(body, root, at), 0, 1), strict=True))
    series = angles.measure(body, root, at)
    measured = dict(zip(series.names, series.value[0], strict=True))
    for name, between in angles.between_centres(centres).items():
        assert measured[name] == pytest.approx(between[0])
    for k in range(size):  # a covariance of one direction gives the size of the gradient in it
        direction = np.zeros((1, size, size))
        direction[0, k, k] = 1.0
        sd = np.radians(angles.measure(body, root, at, direction).sd[0])
        assert np.abs(sd - np.abs(numeric[k])).max() < 1e-7
    factor = rng.normal(size=(size, size))
    sd = np.radians(angles.measure(body, root, at, (factor @ factor.T)[None]).sd[0])
    assert np.allclose(sd, np.linalg.norm(factor.T @ numeric, axis=0), rtol=1e-6)


def straightened(body: Body) -> Body:
    """Return the body with the left hip, knee and ankle on one line at rest."""
    straight = np.array(body.positions)
    straight[body.joint("ankle_l")] = 2 * straight[body.joint("knee_l")] - straight[body.joint("hip_l")]
    return replace(body, positions=straight, twists=twists.screw(body.twists[:, :3], straight[body.screw_joint]))


def without_screws(body: Body, dropped: set[str]) -> Body:
    kept = np.array([name not in dropped for name in body.screw_names])
    arrays = {name: getattr(body, name)[kept] for name in ("twists", "screw_joint", "limits", "rest_spread")}
    return replace(body, screw_names=tuple(np.array(body.screw_names)[kept].tolist()), **arrays)


def test_standard_deviation_of_a_straight_limb_is_finite() -> None:
    body = straightened(stick_body())
    size = 6 + len(body.twists)
    series = angles.measure(body, np.eye(4)[None], np.zeros((1, size - 6)), 1e-4 * np.eye(size)[None])
    assert series.value[0, 0] < 1e-5
    rounded = angles.measure(body, np.eye(4)[None], np.zeros((1, size - 6)), -1e-18 * np.eye(size)[None])
    assert rounded.sd[0, 0] == 0  # a variance that rounding left below zero
    assert 0.5 < series.sd[0, 0] < 2.0  # 0.01 rad about the axes of the knee, and what hip and root add


@pytest.mark.parametrize("axis", [0, 1])
def test_a_straight_limb_bends_as_its_hinge_does(axis: int) -> None:
    body = straightened(stick_body())
    knee = [name for name in body.screw_names if name.startswith("knee_l")]
    body = without_screws(body, {*knee} - {knee[axis]})
    size, seen = 6 + len(body.twists), np.array([name in knee for name in body.screw_names], float)
    series = angles.measure(body, np.eye(4)[None], np.zeros((1, size - 6)), 1e-4 * np.eye(size)[None], seen[None])
    assert series.sd[0, 0] == pytest.approx(np.degrees(0.01), rel=0.05)  # the shank is upright within 15 degrees
    assert series.observed[0, 0] == pytest.approx(1.0)


def test_nothing_is_known_of_an_angle_that_no_screw_changes() -> None:
    body = straightened(stick_body())
    body = without_screws(body, {name for name in body.screw_names if name.startswith("knee_l")})
    size = 6 + len(body.twists)
    series = angles.measure(
        body, np.eye(4)[None], np.zeros((1, size - 6)), 1e-4 * np.eye(size)[None], np.ones((1, size - 6))
    )
    assert np.isnan([series.sd[0, 0], series.observed[0, 0]]).all()
    assert np.isfinite(series.sd[0, 1:]).all()


def test_a_leg_alone_hangs_on_nothing() -> None:
    """No joint says where the hip is flexed from: what the toes do is none of it."""
    body = stick_body(keep=("pelvis", "hip", "knee", "ankle", "toe"))
    leg = [body.joint(f"{name}_r") for name in ("hip", "knee", "ankle", "toe")]
    rows = np.isin(body.screw_joint, leg[1:])
    alone = replace(
        body, joint_names=tuple(body.joint_names[k] for k in leg), parents=np.arange(-1, 3, dtype=np.int32),
        positions=body.positions[leg], twists=body.twists[rows], screw_joint=np.repeat([1, 2, 3], 3).astype(np.int32),
        screw_names=tuple(np.array(body.screw_names)[rows]), limits=body.limits[rows],
        rest_spread=body.rest_spread[rows],
    )  # fmt: skip
    poses = np.zeros((2, 9))
    poses[1, 6:] = 0.5  # of the toes
    found = angles.measure(alone, np.tile(np.eye(4), (2, 1, 1)), poses, np.tile(np.eye(15), (2, 1, 1)))
    hip = found.names.index("hip_flexion_r")
    assert found.value[0, hip] == found.value[1, hip]
    assert np.isnan(found.sd[:, hip]).all()


def test_left_is_level_whatever_the_hips_are() -> None:
    hips = Skeleton(("hip_l", "hip_r"), np.array([-1, 0], np.int32), np.array([[0.1, 0, 1.0], [-0.1, 0, 0.9]]))
    np.testing.assert_allclose(body_directions(hips), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_legs_only_body_has_no_elbows() -> None:
    body = stick_body(keep=("pelvis", "hip", "knee", "ankle", "toe"))
    names = angles.measure(body, np.eye(4)[None], np.zeros((1, len(body.twists)))).names
    assert names == ("knee_flexion_l", "knee_flexion_r", "hip_flexion_l", "hip_flexion_r", "ankle_l", "ankle_r")


def test_an_angle_is_observed_as_far_as_the_joint_that_makes_it() -> None:
    body = stick_body()
    root, at = np.eye(4)[None], np.full((1, len(body.twists)), 0.2)
    seen = np.array([not name.startswith("knee_l") for name in body.screw_names], float)[None]
    shares = angles.measure(body, root, at, observed=seen)
    assert shares.observed[0] == pytest.approx([float(name != "knee_flexion_l") for name in shares.names])
    assert np.isnan(angles.measure(body, root, at).observed).all()


def test_an_angle_is_observed_as_far_as_seen_joints_make_its_variance() -> None:
    body, rng = stick_body(), np.random.default_rng(2)
    count = len(body.twists)
    root, at, seen = np.eye(4)[None], np.full((1, count), 0.2), rng.uniform(size=(1, count))
    alone = [np.diag(np.arange(6 + count) == 6 + k).astype(float)[None] for k in range(count)]
    made = np.concatenate([angles.measure(body, root, at, spread).sd for spread in alone]) ** 2  # by each joint angle
    found = angles.measure(body, root, at, observed=seen).observed
    np.testing.assert_allclose(found, seen @ made / made.sum(axis=0), rtol=1e-9)
