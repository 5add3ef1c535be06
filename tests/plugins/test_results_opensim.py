from dataclasses import replace

import numpy as np
import pytest
from results_scene import ball_body, start_pose, stepping

from mocapflow.assets import Body
from mocapflow.geometry import angles, twists
from mocapflow.io.motion import opensim


def turned(body: Body, **turns_deg: float) -> dict[str, np.ndarray]:
    """Coordinates after turns about axes of the rest pose, e.g. hip_r_x=30; `root_z` turns the person in the world."""
    pose = np.zeros(len(body.twists))
    root = facing = np.diag([-1.0, -1.0, 1.0, 1.0])  # towards world y, which is OpenSim's x
    for name, degrees in turns_deg.items():
        joint, axis = name.rsplit("_", 1)
        if joint == "root":
            turn = np.zeros(6)
            turn["xyz".index(axis)] = np.radians(degrees)
            root = twists.exp(turn) @ facing
        else:
            pose[body.screw_names.index(f"{joint}.{axis}")] = np.radians(degrees)
    return {k: v[0] for k, v in opensim.coordinates(body, root[None], pose[None]).items()}


@pytest.fixture(scope="module")
def upright() -> Body:
    """The demo person with straight, vertical legs and arms hanging bent at the elbow."""
    body = ball_body()
    places = body.positions.copy()
    for s, x in (("l", 0.1), ("r", -0.1)):
        for joint, place in (("hip", (0, 0.9)), ("knee", (0, 0.5)), ("ankle", (0, 0.1)), ("toe", (-0.13, 0.03))):
            places[body.joint(f"{joint}_{s}")] = (x, *place)
        for joint, place in (("shoulder", (0, 1.3)), ("elbow", (0, 1.05)), ("wrist", (-0.1, 0.85))):
            places[body.joint(f"{joint}_{s}")] = (2 * x, *place)
    return replace(body, positions=places, twists=twists.screw(body.twists[:, :3], places[body.screw_joint]))


def test_upright_person_is_at_zero(upright: Body) -> None:
    found = turned(upright)
    elbow = np.degrees(np.arctan2(0.1, 0.2))
    for name, value in found.items():
        if "elbow" in name:
            assert value == pytest.approx(elbow)
        elif name not in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
            assert abs(value) < 1e-9, name


@pytest.mark.parametrize(
    ("turn", "coordinate", "sign"),
    [
        ("hip_r_x", "hip_flexion_r", -1),  # facing -y: a turn about +x swings the leg back
        ("hip_l_x", "hip_flexion_l", -1),
        ("hip_r_y", "hip_adduction_r", -1),
        ("hip_l_y", "hip_adduction_l", 1),
        ("hip_r_z", "hip_rotation_r", 1),
        ("hip_l_z", "hip_rotation_l", -1),
        ("knee_r_x", "knee_angle_r", 1),
        ("knee_l_x", "knee_angle_l", 1),
        ("ankle_r_x", "ankle_angle_r", -1),
        ("root_x", "pelvis_tilt", 1),
        ("root_y", "pelvis_list", 1),
        ("root_z", "pelvis_rotation", 1),
        ("shoulder_r_x", "arm_flex_r", -1),
        ("shoulder_r_y", "arm_add_r", -1),
        ("shoulder_l_y", "arm_add_l", 1),
        ("chest_x", "lumbar_extension", -1),
    ],
)
def test_one_turn_moves_one_coordinate(upright: Body, turn: str, coordinate: str, sign: int) -> None:
    rest, found = turned(upright), turned(upright, **{turn: 20.0})
    assert found[coordinate] - rest[coordinate] == pytest.approx(20 * sign)
    others = [n for n in found if n != coordinate and not n.startswith("pelvis_t")]
    assert max(abs(found[n] - rest[n]) for n in others) < 1e-9


def with_forearms(body: Body, right: np.ndarray) -> Body:
    """The body with another way (3,) m from the right elbow to its wrist at rest, and the left one's mirror image."""
    places = body.positions.copy()
    for side, mirror in (("r", 1), ("l", -1)):
        places[body.joint(f"wrist_{side}")] = places[body.joint(f"elbow_{side}")] + right * [mirror, 1, 1]
    return replace(body, positions=places)


@pytest.mark.parametrize("inward_deg", [0.0, 25.0])
def test_an_arm_that_is_bent_at_rest_shows_how_it_is_turned(upright: Body, inward_deg: float) -> None:
    """The elbow is a hinge: about the upper arm it is turned as far as the forearm points inward."""
    inward, ahead = np.sin(np.radians(inward_deg)), np.cos(np.radians(inward_deg))
    found = turned(with_forearms(upright, np.array([0.1 * inward, -0.1 * ahead, -0.2])))
    assert [found["arm_rot_r"], found["arm_rot_l"]] == pytest.approx([inward_deg] * 2, abs=1e-9)
    assert [found["arm_flex_r"], found["arm_add_l"]] == pytest.approx([0, 0], abs=1e-9)


def test_arms_that_hang_straight_are_at_zero(upright: Body) -> None:
    body = with_forearms(upright, np.array([0, 0, -0.2]))
    found = turned(body)
    assert [value for name, value in found.items() if "arm_" in name or "elbow" in name] == pytest.approx([0] * 8)
    assert turned(body, shoulder_r_x=-20)["arm_flex_r"] == pytest.approx(20)


def test_what_turns_a_clavicle_turns_the_arm_against_the_chest(upright: Body) -> None:
    """OpenSim's models have none: its joint between chest and shoulder would be lost."""
    named = {"spine": "chest", "chest": "clavicle"}
    split = (name.partition(".") for name in upright.screw_names)
    screws = tuple(f"{named.get(joint, joint)}.{axis}" for joint, _, axis in split)
    body = replace(upright, joint_names=tuple(named.get(n, n) for n in upright.joint_names), screw_names=screws)
    rest, found = turned(body), turned(body, clavicle_y=20.0)
    assert {n: found[n] - rest[n] for n in ("arm_add_r", "arm_add_l", "lumbar_bending")} == pytest.approx(
        {"arm_add_r": -20, "arm_add_l": 20, "lumbar_bending": 0}
    )


def test_an_arm_alone_hangs_on_nothing(upright: Body) -> None:
    arm = [upright.joint(name) for name in ("shoulder_r", "elbow_r", "wrist_r")]
    rows = np.isin(upright.screw_joint, arm[1:])
    body = replace(
        upright, joint_names=("shoulder_r", "elbow_r", "wrist_r"), parents=np.arange(-1, 2, dtype=np.int32),
        positions=upright.positions[arm], twists=upright.twists[rows], limits=upright.limits[rows],
        screw_names=tuple(np.array(upright.screw_names)[rows]), screw_joint=np.repeat([1, 2], 3).astype(np.int32),
        rest_spread=upright.rest_spread[rows], skin_joint=np.zeros_like(upright.skin_joint),
    )  # fmt: skip
    assert turned(body, wrist_r_y=20.0) == pytest.approx(turned(body))


def test_hip_flexion_of_a_lifted_knee_is_positive(upright: Body) -> None:
    assert turned(upright, hip_r_x=-60)["hip_flexion_r"] == pytest.approx(60)
    assert turned(upright, elbow_r_x=-30)["elbow_flex_r"] == pytest.approx(30 + np.degrees(np.arctan2(0.1, 0.2)))


def test_knee_is_signed_three_point_angle(upright: Body) -> None:
    assert turned(upright, knee_r_x=-7)["knee_angle_r"] == pytest.approx(-7)
    body = ball_body()
    track = stepping(body)
    found = opensim.coordinates(body, track.root, track.angles)
    series = angles.measure(body, track.root, track.angles)
    assert np.abs(found["knee_angle_l"] - series.value[:, 0]).max() < 4  # the ball knee also turns sideways


def test_ground_is_y_up_and_pelvis_place_in_metres() -> None:
    body = ball_body()
    pose = start_pose(body)
    found = opensim.coordinates(body, pose.root[None], pose.angles[None])
    world = pose.root[:3, :3] @ body.positions[0] + pose.root[:3, 3]
    assert found["pelvis_ty"][0] == pytest.approx(world[2])
    assert found["pelvis_tx"][0] == pytest.approx(world[1])
    assert found["pelvis_tz"][0] == pytest.approx(world[0])
    assert np.linalg.det(opensim.OPENSIM_FROM_WORLD) == pytest.approx(1)


def test_legs_alone_have_no_arms() -> None:
    body = ball_body(("pelvis", "hip_l", "knee_l", "ankle_l", "toe_l", "hip_r", "knee_r", "ankle_r", "toe_r"))
    found = opensim.coordinates(body, np.eye(4)[None], np.zeros((1, len(body.twists))))
    assert not any("arm" in n or "elbow" in n or "lumbar" in n for n in found)
    assert {"hip_flexion_l", "knee_angle_r", "ankle_angle_l"} <= set(found)


def test_axes_of_segments_at_rest_are_rotations_though_limbs_lie_askew():
    for name, axes in opensim.rest_frames(ball_body()).items():
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12, err_msg=name)
        assert np.linalg.det(axes) > 0
