"""The rates that a drape carries along are the slopes of the drape."""

import numpy as np
import pytest
from drape_bodies import EYE, SKIN, SKIRT, leg_poses, legs, lying_cylinder, prepared
from mocapflow_draping.collisions import CLEAR, lift
from mocapflow_draping.drape_rates import FASTEST, Motion
from mocapflow_draping.kinematic import Kinematic
from mocapflow_garments.cylinder import Cylinder
from mocapflow_garments.skirt import Skirt

from mocapflow.data import Past, Pose, PoseBatch
from mocapflow.dressing.roles import Draper
from mocapflow.geometry import differences, twists
from mocapflow.scene import Scene

TUBE = dict(joint="hip_l", start=0.45, upper_circumference_m=0.58, lower_circumference_m=0.60, length_m=0.20)


@pytest.fixture(scope="module", params=[Skirt(**SKIRT), Cylinder(**TUBE)], ids=["skirt", "tube"])
def clothed(request):
    """A body of capsules in a skirt that hangs, and in a tube that rides on a thigh."""
    body = legs()
    return Scene(cameras=(), body=body, garment=request.param.sew(body))


@pytest.mark.long
@pytest.mark.parametrize("sweeps", [0, 4, 40])
def test_velocities_are_the_slopes_of_the_drape(clothed, sweeps, monkeypatch):
    monkeypatch.setattr(differences, "ANGLE_STEP", 1e-5)
    monkeypatch.setattr(differences, "PARAMETER_STEP", 1e-5)
    draper, poses, garment = Kinematic(skin_m=SKIN, sweeps=sweeps), leg_poses(), clothed.garment
    parameters = 0.1 * garment.parameter_bounds[:, 1]
    parameters[garment.parameter_names.index("thickness_m")] /= 2  # at 1 mm one drape jumps within the difference
    for root, angles in zip(poses.root, poses.angles, strict=True):
        pose = Pose(root=root, angles=angles + 0.01)
        asked = pose, parameters, np.arange(len(garment.vertices)), Past(), clothed
        rates, measured = draper.velocity(*asked), Draper.velocity(draper, *asked)
        off = np.linalg.norm(rates - measured, axis=1)
        assert np.median(off) < 2e-3  # m/rad; single contacts come and go, and normals turn along the skin
        assert np.quantile(off, 0.8) < 0.03
        if not sweeps:  # each parameter by itself
            own = slice(-len(parameters), None)
            error, size = (np.linalg.norm(each[..., own], axis=(0, 1)) for each in (rates - measured, measured))
            assert (error <= 0.15 * size).all()


@pytest.mark.parametrize("column", range(6))
def test_the_root_moves_cloth_as_the_drape_says(clothed, column):
    """Turned by little about the world's origin, or shifted: a skirt hangs as before from a pelvis that tilts."""
    draper, poses, step = Kinematic(skin_m=SKIN, sweeps=0), leg_poses(), 1e-5 * np.eye(6)[column]
    calm, every = np.zeros(len(clothed.garment.parameter_names)), np.arange(len(clothed.garment.vertices))
    away = twists.exp(np.array([0, 0, 0, 1.0, -2.0, 0.3]))
    for root, angles in zip(poses.root, poses.angles, strict=True):
        pose = Pose(root=away @ root, angles=angles + 0.01)
        moved = np.stack([twists.exp(sign * step) @ pose.root for sign in (1, -1)])
        both = PoseBatch(root=moved, angles=np.repeat(pose.angles[None], 2, axis=0))
        after, before = draper.drape(both, np.stack([calm, calm]), Past(), clothed)
        rate = draper.velocity(pose, calm, every, Past(), clothed)[..., column]
        off = np.linalg.norm(rate - (after - before) / 2e-5, axis=1)
        assert np.median(off) < 2e-3  # m/rad
        assert np.quantile(off, 0.8) < 0.03


def test_rings_that_buckle_move_no_faster_than_a_reach():
    tight = Cylinder(**(TUBE | dict(start=0.05, upper_circumference_m=0.75, lower_circumference_m=0.75)))
    scene, reach = Scene(cameras=(), body=legs(), garment=tight.sew(legs())), np.arange(0.0, 1.6, 0.2)
    draper, calm = Kinematic(skin_m=SKIN, sweeps=20), np.zeros(len(scene.garment.parameter_names))
    every = np.arange(len(scene.garment.vertices))
    for flexion in reach:
        pose = Pose(root=np.eye(4), angles=np.array([flexion, 0.0, 0.5 * flexion, 0.0]))
        rates = draper.velocity(pose, calm, every, Past(), scene)[..., 6:]
        assert np.linalg.norm(rates, axis=1).max() <= FASTEST + 1e-9


def lifted(grid, rate):
    """Lift the link between two particles beside a cylinder that lies in its middle; return them and their rates."""
    values, posed = prepared(lying_cylinder(0.05), EYE)
    parts, strands = posed[0], len(grid)
    grid, rate, own = grid.copy(), rate.copy(), np.zeros((len(parts), 3, 4, rate.shape[-1]))
    seen, room, near = np.zeros((strands, 3)), np.full(strands, -1.0), np.zeros(strands, np.int64)
    still = np.zeros(rate.shape[-1])
    lift(
        grid, np.zeros(strands, np.int32), np.ones(strands, np.int32), np.array([[-1, 1], [-1, -1]], np.int32), 1,
        seen, room, near, seen.copy(), room.copy(), parts, values, Motion(rate, rate, own, still, still),
    )  # fmt: skip
    return grid, rate


def test_a_link_lifted_off_a_limb_moves_as_its_ends_do():
    grid = np.zeros((2, 2, 3))
    middle = 0.048 * np.array([0.3, 0, 0.954])  # 2 mm inside: deeper, the turning of the normal would count
    grid[:, 0], grid[:, 1] = [[-0.07, 0, 0.2], [0.07, 0, 0.2]], [middle - [0.07, 0, 0], middle + [0.07, 0, 0]]
    rate = np.random.default_rng(0).normal(size=(2, 2, 3, 4))
    after, rates = lifted(grid, rate)
    assert np.linalg.norm(after[:, 1].mean(axis=0)[[0, 2]]) == pytest.approx(0.05 + CLEAR, abs=1e-3)
    for column in range(4):
        step = 1e-5 * rate[..., column]
        slope = (lifted(grid + step, rate)[0] - lifted(grid - step, rate)[0]) / 2e-5
        np.testing.assert_allclose(rates[..., column], slope, atol=0.15)
    assert np.abs(rates - rate).max() > 0.3
