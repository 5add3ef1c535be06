"""A body of fewer faces: it has the same shape, and moves alike."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from mocapflow.data import Pose
from mocapflow.errors import MocapflowError
from mocapflow.geometry import kinematics
from mocapflow.geometry.simplify import simplified
from mocapflow.scene import Scene
from mocapflow.testing import template_body
from mocapflow.testing.bodies import tiny_garment


@pytest.fixture(scope="module")
def body():
    return template_body()


def skin(body, angles):
    return kinematics.skin(body, kinematics.chain(body, Pose(root=np.eye(4), angles=angles))[0], angles)


def test_a_simplified_body_moves_like_the_full_one(body):
    import open3d as o3d

    few = simplified(body, 12_000)
    assert len(few.faces) < 12_100 < len(body.faces)
    angles = np.clip(np.random.default_rng(0).normal(0, 0.3, len(body.twists)), *body.limits.T)
    for bent in (np.zeros(len(body.twists)), angles):
        rays = o3d.t.geometry.RaycastingScene()
        rays.add_triangles(skin(few, bent).astype("f4"), few.faces.astype("u4"))
        off = rays.compute_distance(skin(body, bent).astype("f4")).numpy()
        assert off.mean() < 0.0005
        assert np.quantile(off, 0.99) < 0.002


def test_it_keeps_the_second_shape(body):
    offset = np.random.default_rng(1).normal(0, 0.01, body.vertices.shape)
    few = simplified(replace(body, morph_offset=offset, morph_screw=0), 5000)
    assert few.morph_offset is not None
    assert few.morph_offset.shape == few.vertices.shape
    assert (few.morph_offset[:, None] == offset).all(-1).any(-1).all()


def test_a_garment_stays_pinned_where_it_was(body):
    rings = tiny_garment(body)
    scene = Scene(cameras=(), body=body, garment=rings)
    few = scene.simplified(8000)
    assert few.garment is not None
    apart = few.body.vertices[few.garment.pinned_to] - body.vertices[rings.pinned_to]
    assert np.linalg.norm(apart, axis=1).max() < 0.02
    np.testing.assert_array_equal(few.garment.vertices, rings.vertices)


def test_a_body_of_few_faces_stays_as_it_is(body):
    scene = Scene(cameras=(), body=body)
    assert scene.simplified(len(body.faces)) is scene


def test_without_open3d_the_error_says_what_to_install(body, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)  # makes its import fail
    with pytest.raises(MocapflowError, match=r"^Open3D can't be loaded: .*open3d.*\n.*apt install libusb-1.0-0"):
        simplified(body, 11_000)
