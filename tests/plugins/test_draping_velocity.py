"""The rates that a drape carries along are the slopes of the drape."""

import numpy as np
import pytest
from drape_bodies import SKIN, SKIRT, leg_poses, legs
from mocapflow_draping.following import FASTEST
from mocapflow_draping.kinematic import Kinematic
from mocapflow_garments.cylinder import Cylinder
from mocapflow_garments.skirt import Skirt

from mocapflow.components import Draper
from mocapflow.data import Past, Pose
from mocapflow.geometry import differences
from mocapflow.scene import Scene

TUBE = dict(joint="hip_l", start=0.45, upper_circumference_m=0.58, lower_circumference_m=0.60, length_m=0.20)


@pytest.fixture(scope="module", params=[Skirt(**SKIRT), Cylinder(**TUBE)], ids=["skirt", "tube"])
def clothed(request):
    """A body of capsules in a skirt that hangs, and in a tube that rides on a thigh."""
    body = legs()
    return Scene(cameras=(), body=body, garment=request.param.sew(body))


@pytest.mark.parametrize("sweeps", [0, 4])
def test_velocities_are_the_slopes_of_the_drape(clothed, sweeps, monkeypatch):
    monkeypatch.setattr(differences, "ANGLE_STEP", 1e-5)
    monkeypatch.setattr(differences, "PARAMETER_STEP", 1e-5)
    draper, poses, garment = Kinematic(skin_m=SKIN, sweeps=sweeps), leg_poses(), clothed.garment
    for root, angles in zip(poses.root, poses.angles, strict=True):
        pose, parameters = Pose(root=root, angles=angles + 0.01), 0.1 * garment.parameter_bounds[:, 1]
        asked = pose, parameters, np.arange(len(garment.vertices)), Past(), clothed
        rates, measured = draper.velocity(*asked)[..., 6:], Draper.velocity(draper, *asked)[..., 6:]
        off = np.linalg.norm(rates - measured, axis=1)
        assert np.median(off) < 2e-3  # m/rad; single contacts come and go, and normals turn along the skin
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
