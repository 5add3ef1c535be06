"""The simulated draper: what it is made of, and, where the extra is installed, how the cloth comes to lie."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from drape_bodies import lying_cylinder, prepared
from mocapflow_physics import xpbd
from mocapflow_physics.cloth import links_of
from mocapflow_physics.contacts import find_contacts
from mocapflow_physics.motion import between

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import Cloth, Moment, Past, Pose, PoseBatch
from mocapflow.errors import PipelineError
from mocapflow.help.shipped import shipped
from mocapflow.testing import tiny_scene

SCENE = tiny_scene(clothed=True)
installed = pytest.mark.skipif(find_spec("newton") is None, reason="the extra `physics` is not installed")


def rest(copies=1):
    return PoseBatch(root=np.tile(np.eye(4), (copies, 1, 1)), angles=np.zeros((copies, len(SCENE.body.twists))))


def test_every_edge_of_the_mesh_is_a_link_once():
    garment = replace(SCENE.garment, ring_length=1.25 * SCENE.garment.ring_length)
    pairs, length, stiff = links_of(garment)
    edges = np.unique(np.sort(garment.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    np.testing.assert_array_equal(np.unique(np.sort(pairs, axis=1), axis=0), edges)
    assert len(pairs) == len(edges)
    known = {tuple(pair): own for pair, own in zip(pairs.tolist(), length, strict=True)}
    assert stiff.sum() < 0.8 * len(pairs)
    assert [known[tuple(ring)] for ring in garment.rings.tolist()] == garment.ring_length.tolist()


def test_a_contact_is_the_nearest_place_at_the_contact_distance():
    body = lying_cylinder(0.10)
    values, parts = prepared(body)
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    radius = np.where(np.arange(40) % 2, 0.115, 0.2)
    cloth = np.stack([radius * np.cos(angle), 0 * angle, radius * np.sin(angle)], axis=1)[None]
    particle, place, normal = np.empty(40, np.int32), np.empty((40, 3), np.float32), np.empty((40, 3), np.float32)
    moved = np.arange(40) != 1
    count = find_contacts(cloth, moved, np.array([0.004]), 0.03, parts, values, particle, place, normal)
    assert particle[:count].tolist() == list(range(3, 40, 2))  # near ones; the first is pinned
    np.testing.assert_allclose(np.linalg.norm(place[:count], axis=1), 0.104, atol=1e-3)
    outward = normal[:count] * cloth[0, particle[:count]]  # what lies beyond `count` was never written
    assert (outward.sum(axis=1) > 0.114).all()


def test_the_body_comes_to_its_pose_step_by_step():
    start, end = rest(), PoseBatch(root=np.diag([-1.0, -1.0, 1.0, 1.0])[None] @ np.eye(4), angles=rest().angles + 1)
    poses = between(start, end, 4)
    assert len(poses) == 4
    np.testing.assert_allclose([pose.angles[0, 0] for pose in poses], [0.25, 0.5, 0.75, 1])
    np.testing.assert_allclose(np.abs(poses[1].root[0, :2, :2]), [[0, 1], [1, 0]], atol=1e-12)


def test_without_the_simulator_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(xpbd, "find_spec", lambda name: None)
    with pytest.raises(PipelineError) as caught:
        load_pipeline(shipped("pipelines", "skirt_xpbd.yaml"))
    assert "skirt_xpbd.yaml:4:3" in str(caught.value)
    assert "stages.track.draper: draper xpbd needs the simulator newton: pip install 'mocapflow[physics]'" in str(
        caught.value
    )


@installed
def test_cloth_keeps_its_lengths_and_stays_outside():
    draped = xpbd.Xpbd().drape(rest(), np.zeros((1, 3)), Past(), SCENE)[0]
    strands = draped[SCENE.garment.strands]
    stretch = np.linalg.norm(np.diff(strands, axis=1), axis=2).sum(axis=1)
    whole = np.linalg.norm(np.diff(SCENE.garment.vertices[SCENE.garment.strands], axis=1), axis=2).sum(axis=1)
    np.testing.assert_allclose(stretch, whole, rtol=0.05)
    for leg in (0.1, -0.1):
        below = strands[strands[..., 2] < 0.8]
        assert np.hypot(below[:, 0] - leg, below[:, 1]).min() > 0.045


@installed
def test_wind_blows_all_strands_the_same_way():
    calm, windy = np.zeros(3), np.array([0, 0, -0.3])
    still, blown = xpbd.Xpbd().drape(rest(2), np.stack([calm, windy]), Past(), SCENE)
    hem = SCENE.garment.strands[:, -1]
    moved = (blown - still)[hem].mean(axis=0)
    assert moved[1] < -0.03
    assert abs(moved[0]) < 0.01


@installed
def test_what_folds_take_up_the_hem_hangs_higher():
    names, bounds = SCENE.garment.parameter_names, SCENE.garment.parameter_bounds
    garment = replace(
        SCENE.garment, parameter_names=(*names, "take_up"), parameter_bounds=np.concatenate([bounds, [[0, 0.15]]])
    )
    parameters = np.array([[0, 0, 0, 0.0], [0, 0, 0, 0.1]])
    whole, taken = xpbd.Xpbd().drape(rest(2), parameters, Past(), replace(SCENE, garment=garment))
    strands = garment.strands
    lengths = [np.linalg.norm(np.diff(cloth[strands], axis=1), axis=2).sum(axis=1) for cloth in (whole, taken)]
    np.testing.assert_allclose(lengths[1] / lengths[0], 0.9, rtol=0.03)


@installed
def test_it_is_repeatable_and_goes_on_from_the_last_frame():
    draper, parameters = xpbd.Xpbd(), np.zeros((1, 3))
    raised = rest()
    raised.angles.setflags(write=True)
    raised.angles[0, SCENE.body.screw_names.index("hip_l.flexion")] = 1.0
    first = draper.drape(raised, parameters, Past(), SCENE)[0]
    np.testing.assert_array_equal(draper.drape(raised, parameters, Past(), SCENE)[0], first)
    pose = Pose(root=np.eye(4), angles=raised.angles[0].copy())
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=Cloth(vertices=first, parameters=parameters[0])),))
    again = draper.drape(raised, parameters, past, SCENE)[0]
    swung = np.linalg.norm(first - SCENE.garment.vertices, axis=1)
    assert np.linalg.norm(again - first, axis=1).mean() < 0.5 * swung.mean()
