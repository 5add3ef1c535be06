"""Cloth that begins near the limb that carries it, and how well the body holds what lies on it."""

from dataclasses import replace

import numpy as np
import pytest
from drape_bodies import SKIN, SKIRT, draper, leg_poses, legs, lying_cylinder, prepared, skirted
from mocapflow_draping.collisions import LEVEL, supported
from mocapflow_draping.directions import along_limbs, standing_out
from mocapflow_draping.relaxation import hold, relax
from mocapflow_garments.skirt import Skirt
from scipy.spatial.transform import Rotation

from mocapflow.data import Past, PoseBatch
from mocapflow.geometry import twists
from mocapflow.geometry.kinematics import chain_batch
from mocapflow.scene import Scene

LINK, TURNS = 0.05, 5
FORWARD, DOWN = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0])


def one_bar():
    """Return a strand of one bar that hangs straight down, and what `hold` needs beside it."""
    grid = np.array([[[0.1, 0.2, 1.0], [0.1, 0.2, 1.0 - LINK]]])
    return grid, np.full((1, 1), LINK), np.zeros(1, np.int32), np.ones(1, np.int32)


@pytest.mark.parametrize("near", [10, 45, 80])
def test_a_bar_stands_near_its_limb_and_sinks_to_where_it_hung(near):
    grid, links, first, last = one_bar()
    hung, target, left = grid.copy(), np.zeros((1, 3)), np.zeros(1)
    assert hold(grid, FORWARD[None], links, first, last, 1, np.radians(near), target, left)
    bar = (grid[0, 1] - grid[0, 0]) / LINK
    np.testing.assert_allclose([bar @ FORWARD, bar @ DOWN], [np.cos(np.radians(near)), np.sin(np.radians(near))])
    np.testing.assert_allclose(left, np.radians(90 - near))
    for turn in range(TURNS):
        relax(grid, links, 1, target, left, TURNS)
        angle = np.arctan2(*((grid[0, 1] - grid[0, 0]) @ np.stack([FORWARD, DOWN], axis=1)))
        np.testing.assert_allclose(angle, left[0] * (1 - (turn + 1) / TURNS), atol=1e-7)
    np.testing.assert_allclose(grid, hung, atol=1e-8)


def test_a_bar_that_hangs_near_its_limb_stays():
    grid, links, first, last = one_bar()
    hung, left = grid.copy(), np.ones(1)
    assert not hold(grid, DOWN[None], links, first, last, 1, np.radians(45), np.zeros((1, 3)), left)
    relax(grid, links, 1, np.zeros((1, 3)), left, TURNS)
    np.testing.assert_array_equal(grid, hung)
    np.testing.assert_array_equal(left, 0)


@pytest.mark.parametrize("slope", [0, 30, 60, 90, 180])
def test_the_body_holds_what_lies_on_top_of_it(slope):
    values, parts = prepared(lying_cylinder(0.1))
    place = (0.1 + SKIN) * np.array([np.sin(np.radians(slope)), 0, np.cos(np.radians(slope))])
    grid, room, near = place[None, None], np.zeros(1), np.zeros(1, np.int64)
    held = supported(grid, 0, 0, room, near, parts[0], values)
    np.testing.assert_allclose(held, np.clip(np.cos(np.radians(slope)) / LEVEL, 0, 1), atol=0.05)  # normals of voxels
    assert supported(grid, 0, 0, room + 0.01, near, parts[0], values) == 0  # it hangs beside


def test_strands_on_top_of_a_trunk_that_lies_point_to_the_legs():
    scene = skirted()
    strands, lying = draper().fitting(scene.garment, scene.body).strands, np.eye(4)
    lying[:3, :3] = Rotation.from_rotvec([np.radians(100), 0, 0]).as_matrix()  # face down, the head a little low
    chain = chain_batch(scene.body, PoseBatch(root=lying[None], angles=np.zeros((1, 4))))
    out, up = standing_out(strands, chain)[0], (strands.facing @ lying[:3, :3].T)[:, 2]
    to_legs = -lying[:2, 2] / np.linalg.norm(lying[:2, 2])
    assert (out[up > 0.5][:, :2] @ to_legs > 0.5).all()
    assert (strands.facing[up > 0.5] @ lying[:3, :3].T @ [*to_legs, 0] < 0).all()  # by themselves they face the head
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1)
    np.testing.assert_allclose(out[:, 2], 0)


def test_a_strand_goes_with_the_thigh_under_it():
    scene = skirted()
    strands = draper().fitting(scene.garment, scene.body).strands
    angles = np.radians([[90.0, 0, 0, 0]])
    along = along_limbs(strands, chain_batch(legs(), PoseBatch(root=np.eye(4)[None], angles=angles)))[0]
    left, right = strands.limb == 1, strands.limb == 3
    assert left[strands.facing[:, 0] > 0.9].all()
    assert right[strands.facing[:, 0] < -0.9].all()
    assert (along[left] @ FORWARD > 0.9).all()
    assert (along[right] @ DOWN > 0.9).all()


@pytest.mark.long
def test_a_skirt_closes_over_a_leg_that_is_raised_aside():
    """The trunk lies on its side, one leg stands and the other is level: T-CL4 allows 0.24."""
    body, aside = legs(), np.array([[0.0, -1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
    body = replace(body, twists=twists.screw(aside, body.positions[1:]))
    scene, root = Scene(cameras=(), body=body, garment=Skirt(**SKIRT).sew(body)), np.eye(4)
    root[:3, :3] = Rotation.from_rotvec([0, np.radians(-90), 0]).as_matrix()
    pose = PoseBatch(root=root[None], angles=np.radians([[0.0, 0, 90, 0]]))
    cloth = draper().drape(pose, np.zeros((1, len(scene.garment.parameter_names))), Past(), scene)[0]
    a, b = scene.garment.rings.T
    longer = np.linalg.norm(cloth[a] - cloth[b], axis=1) / scene.garment.ring_length - 1
    assert np.quantile(longer, 0.99) < 0.12


@pytest.mark.parametrize("sweeps", [1, 3])
def test_cloth_that_has_no_time_to_sink_is_not_held(sweeps):
    scene, poses = skirted(), leg_poses()
    calm = np.zeros((len(poses.root), len(scene.garment.parameter_names)))
    held, free = (draper(sweeps=sweeps, hold_deg=d).drape(poses, calm, Past(), scene) for d in (45.0, 180.0))
    np.testing.assert_array_equal(held, free)
    longer, loose = (draper(sweeps=8, hold_deg=d).drape(poses, calm, Past(), scene) for d in (45.0, 180.0))
    assert np.abs(longer - loose).max() > 1e-3  # with time, some bars are
