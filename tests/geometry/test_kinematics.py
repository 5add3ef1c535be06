"""T-BODY1 and T-GEO3: the chain against chained matrix exponentials, its Jacobian against differences."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_bodies.scanned import Scanned
from scipy.linalg import expm

from mocapflow.data import Pose, PoseBatch
from mocapflow.errors import ShapeError
from mocapflow.geometry import kinematics, twists
from mocapflow.geometry.joints import angles_from_rotations, decompose
from mocapflow.model import moved
from tests.fixtures.turns import rotations_from_angles

RECORDING = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


@pytest.fixture(scope="module")
def body():
    return Scanned().load(RECORDING)


@pytest.fixture
def pose(body):
    rng = np.random.default_rng(1)
    return Pose(root=twists.exp(rng.normal(size=6)), angles=rng.uniform(*body.limits.T))


def test_rest_pose_reproduces_the_mesh(body):
    rest = Pose(root=np.eye(4), angles=np.zeros(len(body.twists)))
    joints, screws = kinematics.chain(body, rest)
    np.testing.assert_allclose(kinematics.skin(body, joints, rest.angles), body.vertices, atol=1e-12)
    np.testing.assert_allclose(screws, body.twists, atol=1e-15)


def test_chain_equals_chained_matrix_exponentials(body, pose):
    joints, _ = kinematics.chain(body, pose)
    for joint in range(len(body.joint_names)):
        path, above = [], joint
        while above >= 0:
            path, above = [above, *path], body.parents[above]
        expected = pose.root
        for member in path:
            for screw in np.flatnonzero(body.screw_joint == member):
                wedge = np.zeros((4, 4))
                wedge[:3, :3], wedge[:3, 3] = twists.hat(body.twists[screw, :3]), body.twists[screw, 3:]
                expected = expected @ expm(pose.angles[screw] * wedge)
        np.testing.assert_allclose(joints[joint], expected, atol=1e-12)


def test_one_joint_moves_only_its_subtree(body):
    angles = np.zeros(len(body.twists))
    angles[body.screw_names.index("knee_l.flexion")] = 1.0
    joints, _ = kinematics.chain(body, Pose(root=np.eye(4), angles=angles))
    below = kinematics.descendants(body.parents)[body.joint("knee_l")]
    assert [n for n, b in zip(body.joint_names, below, strict=True) if b] == ["knee_l", "ankle_l", "toe_l"]
    assert kinematics.descendants(body.parents)[0].all()  # all hang on the root
    moved = np.linalg.norm(kinematics.skin(body, joints, angles) - body.vertices, axis=1)
    share = np.where(below[body.skin_joint], body.skin_weight, 0.0).sum(axis=1)
    assert (moved[share == 0] < 1e-12).all() and moved[share > 0.5].min() > 1e-3
    np.testing.assert_allclose(joints[~below], np.broadcast_to(np.eye(4), joints[~below].shape), atol=1e-12)


def test_batch_equals_one_by_one(body, pose):
    poses = PoseBatch(root=np.stack([np.eye(4), pose.root]), angles=np.stack([0 * pose.angles, pose.angles]))
    np.testing.assert_array_equal(kinematics.chain_batch(body, poses)[1], kinematics.chain(body, pose)[0])


def test_the_root_is_where_its_joint_is(body, pose):
    roots = np.stack([np.eye(4), pose.root])
    posed = kinematics.joint_positions(body, kinematics.chain(body, pose)[0])
    np.testing.assert_allclose(kinematics.root_position(body, roots), [body.positions[0], posed[0]], atol=1e-12)
    np.testing.assert_array_equal(kinematics.root_position(body, pose.root), kinematics.root_position(body, roots)[1])


def test_morph_changes_the_shape_with_its_angle(body, pose):
    offset = np.random.default_rng(2).normal(scale=0.01, size=body.vertices.shape)
    screw = body.screw_names.index("knee_l.flexion")
    morphing = replace(body, morph_offset=offset, morph_screw=screw, morph_range=(0.2, 1.4))
    for angle, share in ((0.0, 0.0), (0.2, 0.0), (0.8, 0.5), (1.4, 1.0), (2.0, 1.0)):
        angles = np.zeros(len(body.twists))
        angles[screw] = angle
        joints, _ = kinematics.chain(body, Pose(root=pose.root, angles=angles))
        expected = kinematics.skin(replace(body, vertices=body.vertices + share * offset), joints, angles)
        np.testing.assert_allclose(kinematics.skin(morphing, joints, angles), expected, atol=1e-12)


@pytest.mark.parametrize("morphs", [(), (-0.3, 0.5), (0.5, -0.3)])
def test_velocities_are_the_derivative_of_the_skin(body, pose, morphs):
    step, some = 1e-6, np.arange(0, len(body.vertices), 97, np.int32)
    if morphs:
        screw = body.screw_names.index("knee_l.flexion")
        offset = np.random.default_rng(2).normal(scale=0.02, size=body.vertices.shape)
        near = pose.angles[screw]
        body = replace(body, morph_offset=offset, morph_screw=screw, morph_range=tuple(near + off for off in morphs))

    def places(shift):
        at = moved(pose, shift)
        return kinematics.skin(body, kinematics.chain(body, at)[0], at.angles)[some]

    found = kinematics.skin_velocities(body, *kinematics.chain(body, pose), pose.angles, some)
    numeric = [(places(step * way) - places(-step * way)) / (2 * step) for way in np.eye(found.shape[2])]
    np.testing.assert_allclose(found, np.stack(numeric, axis=2), atol=1e-8)


def test_a_pose_of_another_body_is_refused(body, pose):
    with pytest.raises(ShapeError, match=f"a pose of 3 angles; the body has {len(body.twists)}"):
        kinematics.chain(body, replace(pose, angles=pose.angles[:3]))


def test_three_screws_reach_any_rotation_exactly(body):
    rng = np.random.default_rng(8)
    balls = [n for j, n in enumerate(body.joint_names) if (body.screw_joint == j).sum() == 3]
    assert {"hip_l", "knee_r", "shoulder_l", "elbow_r", "spine"} <= set(balls)
    for _ in range(5):
        turns = {name: rng.uniform(-1.2, 1.2, 3) for name in balls}
        angles = angles_from_rotations(body, turns)
        assert not angles[[body.joint_names[joint] not in balls for joint in body.screw_joint]].any()  # the rest rests
        back = rotations_from_angles(body, angles)
        for name in balls:
            np.testing.assert_allclose(back[name], turns[name], atol=1e-9)


def test_a_joint_without_screws_has_no_angles(body):
    root = body.joint_names[0]
    assert 0 not in body.screw_joint and not angles_from_rotations(body, {root: np.ones(3)}).any()


def composed(axes, angles):
    """The rotation that turns about axes make up, the first outermost."""
    made = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        made = made @ expm(angle * twists.hat(axis))
    return made


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 0, 2], [2, 1, 0]])  # right-handed and left-handed
@pytest.mark.parametrize("middle", [-np.pi / 2, -0.7, 0.9, np.pi / 2])  # gimbal lock at both ends
def test_turns_about_three_axes_are_found_again(order, middle):
    axes = np.eye(3)[order]
    rotation = composed(axes, [0.3, middle, 0.4])
    np.testing.assert_allclose(composed(axes, decompose(axes, rotation)), rotation, atol=1e-9)


@pytest.mark.parametrize("first", [0, 1, 2])
def test_fewer_screws_come_as_near_as_they_can(first):
    axes = np.eye(3)[[first, (first + 1) % 3]]
    rotation = twists.exp(np.array([0.5, -0.3, 0.2, 0, 0, 0]))[:3, :3]
    best = decompose(axes, rotation)

    def miss(angles):
        return np.linalg.norm(composed(axes, angles) - rotation)

    for move in np.vstack([np.eye(2), -np.eye(2)]) * 1e-3:
        assert miss(best) < miss(best + move)
