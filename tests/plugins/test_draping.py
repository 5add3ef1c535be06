"""The drape on analytic bodies (T-CL1 to T-CL3), and the distance fields under it."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from drape_bodies import (
    SKIN,
    ball,
    box,
    check_whole_and_outside,
    distances,
    draper,
    leg_poses,
    legs,
    lying_cylinder,
    prepared,
    skirted,
    swing,
    together,
)
from mocapflow_draping.distance import outwards
from mocapflow_draping.kinematic import Kinematic
from mocapflow_draping.literal import settle_in_steps
from mocapflow_draping.strands import strands_of
from mocapflow_draping.swing import TOUCH
from mocapflow_draping.voxels import signed_distance
from mocapflow_garments.shorts import Shorts
from mocapflow_garments.skirt import Skirt
from scipy.optimize import brentq

from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.errors import PluginError
from mocapflow.geometry import kinematics, sewing
from mocapflow.scene import Scene
from mocapflow.testing.bodies import tiny_body


def literal(body, grid, fixed, step=2.0, iterations=50, limited=True, in_space=False):
    """Return a grid (N, L, 3) laid step by step, and what is fixed."""
    values, parts = prepared(body)
    grid, fixed = grid[None].copy(), fixed[None].copy()
    first, last = np.zeros(grid.shape[1], np.int32), np.full(grid.shape[1], grid.shape[2] - 1, np.int32)
    turns = np.radians(step), iterations, limited, in_space
    settle_in_steps(grid, fixed, first, last, np.array([SKIN]), *turns, parts, values)
    return grid[0], fixed[0]


def strand(count, link, height):
    """Return one level strand along x from the origin."""
    x = link * np.arange(count)
    return np.stack([x, 0 * x, np.full(count, height)], axis=1)[None]


def test_distances_of_a_box_are_exact():
    body = box([-0.1, -0.2, -0.3], [0.1, 0.2, 0.3])
    origin = np.full(3, -0.5)
    distance, _ = signed_distance(body.vertices, body.faces, origin, (51, 51, 51), 0.02)
    points = origin + 0.02 * np.stack(np.meshgrid(*[np.arange(51)] * 3, indexing="ij"), -1)
    over = np.abs(points) - [0.1, 0.2, 0.3]
    exact = np.linalg.norm(np.maximum(over, 0), axis=-1) + np.minimum(over.max(-1), 0)
    np.testing.assert_allclose(distance, exact, atol=1e-12)


@pytest.mark.long
def test_fields_follow_the_joints():
    scene, poses = skirted(), leg_poses()
    shins = (scene.body.vertices[:, 2] > 0.15) & (scene.body.vertices[:, 2] < 0.4)
    chains = kinematics.chain_batch(scene.body, poses)
    skins = [kinematics.skin(scene.body, *posed) for posed in zip(chains, poses.angles, strict=True)]
    off = distances(scene.body, np.stack(skins)[:, shins], poses)
    assert np.abs(off).max() < 1.5e-3  # coarse facets of the capsule and coarse voxels


def test_out_of_a_cylinder_is_away_from_its_axis():
    values, parts = prepared(lying_cylinder(0.1))
    for angle in np.linspace(0.3, 6.0, 12):
        away = np.array([np.cos(angle), 0.0, np.sin(angle)])
        np.testing.assert_allclose(outwards(*(0.097 * away), 0, parts[0], values), away, atol=0.03)


def test_a_raised_thigh_does_not_come_out_behind_the_body():
    scene = skirted()
    raised = PoseBatch(root=np.eye(4)[None], angles=np.radians([[90.0, 90.0, 0, 0]]))
    behind = np.array([[[0.05, 0.15, 0.92]]])  # the pelvis ends at 0.12
    assert distances(scene.body, behind, raised)[0, 0] > 0.02


def test_a_flat_cloth_lies_on_a_plane_undeformed():
    """T-CL1."""
    table = box([-0.3, -0.3, -0.1], [0.3, 0.3, 0.0])
    grid = np.stack(np.meshgrid(np.linspace(-0.2, 0.2, 9), np.linspace(-0.2, 0.2, 9), indexing="ij"), -1)
    grid = np.concatenate([grid, np.full((9, 9, 1), 0.05)], -1)
    laid, fixed = literal(table, grid, np.zeros((9, 9), bool))
    assert fixed.all()
    np.testing.assert_allclose(laid[..., :2], grid[..., :2], atol=1e-12)
    assert np.ptp(laid[..., 2]) == 0
    assert SKIN - 0.002 - 1e-6 <= laid[0, 0, 2] < SKIN


def test_an_overhang_hangs_straight_down_and_keeps_its_length():
    """T-CL2: where a taut string of such bars would hang, as far as `TOUCH` early counts as touching."""
    table, edge = box([-0.3, -0.3, -0.1], [0.105, 0.3, 0.0]), 0.105
    ((laid,),), ((supported,),) = swing(table, [[0.0, 0.0, SKIN]], [1.0, 0.0, 0.0], 31, 0.01)
    assert 11 <= supported <= 22
    straight = laid[supported] - np.outer(0.01 * np.arange(31 - supported), [0, 0, 1])
    assert np.abs(laid[supported:] - straight).max() < 1e-4
    assert np.abs(np.linalg.norm(np.diff(laid, axis=0), axis=1) - 0.01).max() < 1e-12

    def around(away):
        """How high a bar from the last particle on top, at x = 0.1, ends so far from the edge."""

        def off(angle):
            x, z = 0.1 + 0.01 * np.cos(angle) - edge, SKIN - 0.01 * np.sin(angle)
            return np.hypot(x, max(z, 0.0)) - away

        return SKIN - 0.01 * np.sin(brentq(off, 0.0, np.pi / 3))

    assert SKIN - 1e-6 <= laid[-1, 0] - edge < SKIN + TOUCH
    assert laid[-1, 1] == 0
    assert around(SKIN) - 1e-6 <= laid[-1, 2] + 0.01 * 19 < around(SKIN + TOUCH) + 1e-6


def test_without_the_limit_it_swings_by_no_more_than_a_step():
    """T-CL2."""
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    fixed = np.zeros((1, 11), bool)
    fixed[0, 0] = True
    laid, _ = literal(nothing, strand(11, 0.01, 0.0), fixed, limited=False)
    bar = laid[0, -1] - laid[0, 0]
    assert np.degrees(np.arctan2(np.hypot(*bar[:2]), -bar[2])) <= 2.0 + 1e-9


def test_pivots_are_the_nearest_along_the_strand_or_in_space():
    """The end of one strand lies beside a fixed point of the other: in space it swings about that, and tears off."""
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    two = np.concatenate([strand(11, 0.01, 0.0), strand(11, 0.01, 0.0) + [0.11, 0, 0]])
    fixed = np.zeros((2, 11), bool)
    fixed[:, 0] = True
    along, _ = literal(nothing, two, fixed)
    across, _ = literal(nothing, two, fixed, in_space=True)
    np.testing.assert_allclose(along[:, -1], [[0, 0, -0.1], [0.11, 0, -0.1]], atol=1e-9)
    np.testing.assert_allclose(across[0, -1], [0.11, 0, -0.01], atol=1e-9)


def test_a_level_strand_hangs_after_45_steps():
    """T-CL2."""
    nothing = box([5, 5, 5], [5.1, 5.1, 5.1])
    fixed = np.zeros((1, 11), bool)
    fixed[0, 0] = True
    almost, _ = literal(nothing, strand(11, 0.01, 0.0), fixed, iterations=44)
    hanging, _ = literal(nothing, strand(11, 0.01, 0.0), fixed, iterations=45)
    assert almost[0, -1, 0] > 1e-3
    np.testing.assert_allclose(hanging[0, -1], [0, 0, -0.1], atol=1e-9)


@pytest.mark.parametrize("link", [0.002, 0.01, 0.02])
def test_a_strand_over_a_cylinder_is_taut(link):
    """T-CL2."""
    radius, length = 0.1, 0.32
    count = round(length / link) + 1
    laid, _ = swing(lying_cylinder(radius), [[0.0, 0.0, radius + SKIN]], [1.0, 0.0, 0.0], count, link)
    away = radius + SKIN
    chords = np.linalg.norm(np.diff(laid[0, 0], axis=0), axis=1)
    assert np.abs(chords - link).max() < 1e-12
    tip = np.array([away, 0.0, -(length - np.pi / 2 * away)])
    assert np.linalg.norm(laid[0, 0, -1] - tip) < 5e-4


def test_strands_over_a_sphere_lie_on_its_meridians():
    """T-CL1."""
    radius, link, count = 0.1, 0.01, 33
    away, azimuth = radius + SKIN, 2 * np.pi * np.arange(12) / 12
    facing = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    laid, _ = swing(ball(radius), np.tile([0.0, 0.0, away], (12, 1)), facing, count, link)
    bars = np.linalg.norm(np.diff(laid[0], axis=1), axis=-1)
    assert np.abs(bars - link).max() < 1e-12
    aside = np.abs(np.einsum("nla,na->nl", laid[0], np.cross(facing, [0, 0, 1.0])))
    assert aside.max() < 1e-12
    tips = away * facing - np.array([0, 0, link * (count - 1) - np.pi / 2 * away])
    assert np.linalg.norm(laid[0, :, -1] - tips, axis=1).max() < 5e-4
    assert np.linalg.norm(laid[0], axis=-1).min() > away - 1e-4


def test_a_cloth_on_a_bumpy_plane_hangs_taut_from_bump_to_bump():
    """T-CL1: two ridges across a table: level between them, tents to both sides, all strands as long as they were."""
    ridges = (-0.1, 0.1)
    table = together(
        box([-0.5, -0.3, -0.1], [0.5, 0.3, 0.0]),
        *(box([x - 0.01, -0.3, -0.05], [x + 0.01, 0.3, 0.05]) for x in ridges),
    )
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 31), np.linspace(-0.1, 0.1, 5))
    grid = np.stack([x, y, np.full(x.shape, 0.08)], axis=-1)
    laid, fixed = literal(table, grid, np.zeros(x.shape, bool))
    between, top = np.abs(x) <= 0.1, 0.05 + SKIN
    assert fixed[np.abs(np.abs(x) - 0.1) < 0.005].all() and not fixed[np.abs(x) < 0.08].any()
    assert np.ptp(laid[between][:, 2]) == 0 and top - 0.002 - 1e-6 <= laid[between][0, 2] < top
    np.testing.assert_array_equal(laid[between][:, :2], grid[between][:, :2])
    for end in (0, -1):
        assert fixed[:, end].all()
        assert (np.abs(laid[:, end, 2] - SKIN) < 0.2 * np.radians(2.0)).all()  # a step goes on into the table
    lengths = np.linalg.norm(np.diff(laid, axis=1), axis=-1)
    assert np.abs(lengths / 0.02 - 1).max() < 1e-9
    np.testing.assert_allclose(laid[..., 1], y, atol=1e-12)


def calm(scene, count):
    return np.zeros((count, len(scene.garment.parameter_names)))


def test_a_skirt_keeps_its_strands_and_stays_outside():
    """T-CL3."""
    scene, poses = skirted(), leg_poses()
    draped = draper(sweeps=0).drape(poses, calm(scene, 4), Past(), scene)
    check_whole_and_outside(scene, draped, poses)
    free = np.setdiff1d(np.arange(draped.shape[1]), scene.garment.pinned)
    nearest = [exact_distances(scene.body, *each).min() for each in zip(draped[:, free], each_of(poses), strict=True)]
    assert min(nearest) > SKIN - 2.5e-4  # 0.1 mm by its own field, whose voxels of 5 mm read up to 0.2 mm too far


def each_of(poses):
    return [Pose(root=root, angles=angles) for root, angles in zip(poses.root, poses.angles, strict=True)]


def exact_distances(body, points, pose):
    """Return the signed distances of points (N, 3) to the triangles of a body, each part of which is closed."""
    import open3d

    skin = kinematics.skin(body, kinematics.chain(body, pose)[0], pose.angles).astype("f4")
    owner, away = body.skin_joint[body.faces[:, 0], 0], []
    for part in range(len(body.joint_names)):
        rays = open3d.t.geometry.RaycastingScene()
        rays.add_triangles(skin, body.faces[owner == part].astype("u4"))
        away.append(rays.compute_signed_distance(points.astype("f4")).numpy())
    return np.min(away, axis=0)


def test_the_chapters_steps_end_near_the_taut_drape():
    scene, poses = skirted(), leg_poses()
    taut = draper(sweeps=0).drape(poses, calm(scene, 4), Past(), scene)
    steps = draper(sweeps=0, rule="literal", limited=True).drape(poses, calm(scene, 4), Past(), scene)
    assert np.linalg.norm(taut - steps, axis=-1)[0].mean() < 0.01


@pytest.mark.parametrize("settings", [dict(), dict(limited=True), dict(iterations=100)], ids=str)
def test_the_chapters_steps_keep_the_strands_lengths(settings):
    """T-CL3: what lies between two fixed particles is taut, and is not swung."""
    scene, poses = skirted(), leg_poses()
    draped = draper(sweeps=0, rule="literal", **settings).drape(poses, calm(scene, 4), Past(), scene)
    strands = strands_of(scene.garment, scene.body)
    lengths = np.linalg.norm(np.diff(draped[:, strands.vertex], axis=2), axis=-1)
    assert np.abs(lengths / strands.links - 1).max() < 1e-9


def test_a_batch_is_its_drapes_one_by_one():
    scene, poses = skirted(), leg_poses()
    parameters = calm(scene, 4)
    parameters[:, :6] = np.random.default_rng(0).uniform(-0.1, 0.1, (4, 6))
    parameters[:, 6] = [0.0, 0.02, 0.05, 0.1]
    together = draper().drape(poses, parameters, Past(), scene)
    for row in range(4):
        one = type(poses)(root=poses.root[row : row + 1].copy(), angles=poses.angles[row : row + 1].copy())
        np.testing.assert_array_equal(draper().drape(one, parameters[row : row + 1], Past(), scene)[0], together[row])


def test_a_draper_that_has_draped_can_be_sent_to_another_process():
    scene, poses, draper = skirted(), leg_poses(), Kinematic()
    parameters = calm(scene, len(poses.root))
    draped = draper.drape(poses, parameters, Past(), scene)
    sent = pickle.loads(pickle.dumps(draper))
    assert np.array_equal(sent.drape(poses, parameters, Past(), scene), draped)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda g: dict(strands=g.strands[1:]), "vertex 0 lies on 0 strands"),
        (lambda g: dict(strands=np.append(g.strands, g.strands[:1], axis=0)), "vertex 0 lies on 2 strands"),
        (lambda g: dict(pinned=g.pinned[1:], pinned_to=g.pinned_to[1:]), "strand of vertex 0 hangs from nothing"),
        (lambda g: dict(rings=g.rings + np.eye(len(g.rings), 2, 1, dtype=np.int32)), "ring link .* of two rows"),
    ],
)
def test_a_garment_that_no_strands_make_up_says_so(spoil, said):
    scene = skirted()
    with pytest.raises(PluginError, match=said):
        strands_of(replace(scene.garment, **spoil(scene.garment)), scene.body)


def test_a_sheet_whose_middle_hangs_straight_down_says_so():
    body = tiny_body()
    line, down = np.linspace(-0.1, 0.1, 5), np.linspace(0.0, -0.4, 6)
    straight = np.stack(np.broadcast_arrays(line[:, None], -0.2, 1.0 + down), axis=-1)
    with pytest.raises(PluginError, match="apron: strand 2 hangs straight down"):
        strands_of(sewing.sheet("apron", body, straight, closed=False), body)


def test_joints_that_it_can_not_touch_do_not_move_the_cloth():
    body = tiny_body()
    measures = dict(waist_height_m=1.05, waist_circumference_m=1.05, hem_circumference_m=1.1, length_m=0.15)
    scene = Scene(cameras=(), body=body, garment=Skirt(**measures).sew(body))
    kinematic = Kinematic()
    touchable = kinematic.touchable(scene)
    assert touchable[[body.joint("pelvis"), body.joint("hip_l"), body.joint("hip_r")]].all()
    below = np.flatnonzero(~touchable[body.screw_joint])
    assert len(below)
    angles = np.zeros((2, len(body.twists)))
    angles[1, below] = 0.3
    poses = PoseBatch(root=np.tile(np.eye(4), (2, 1, 1)), angles=angles)
    still, moved = kinematic.drape(poses, calm(scene, 2), Past(), scene)
    np.testing.assert_array_equal(still, moved)


@pytest.mark.long
@pytest.mark.parametrize(("length", "inseam"), [(0.80, 0.46), (0.98, 0.64)], ids=["below the knee", "to the ankle"])
def test_legs_of_shorts_stay_around_the_shank(length, inseam):
    body, poses = legs(), leg_poses()
    garment = Shorts(
        waist_height_m=1.08, waist_circumference_m=0.92, hip_circumference_m=1.1, leg_opening_circumference_m=0.5,
        inseam_m=inseam, length_m=length,
    ).sew(body)  # fmt: skip
    scene = Scene(cameras=(), body=body, garment=garment)
    drape = draper().drape(poses, np.zeros((4, len(garment.parameter_names))), Past(), scene)
    hem = garment.strands[:, -1][: len(garment.strands) * 3 // 4]
    assert {body.joint_names[joint] for joint in garment.carried_by[hem]} == {"hip_l", "hip_r"}
    chain = kinematics.chain_batch(body, poses)
    for side, (knee, x) in enumerate([(2, 0.1), (4, -0.1)]):
        ring = drape[:, np.split(hem, 2)[side]]
        shank = chain[:, knee, :3, :3] @ [0, 0, -1.0]
        top = (chain[:, knee] @ [x, 0, 0.48, 1])[:, :3]
        beside = np.cross(ring.mean(axis=1) - top, shank)
        assert np.linalg.norm(beside, axis=1).max() < 0.08
