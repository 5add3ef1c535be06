"""The scene and its model: which vertices are whose, and the garment laid on several poses or on none."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.data import CLOTH, Past
from mocapflow.geometry.meshes import lengths_along
from mocapflow.model import ClothedModel
from mocapflow.pooling import pool, weighted
from mocapflow.testing import scenes

SCENE = scenes.tiny_scene(clothed=True)
POSE = scenes.tiny_pose(SCENE, 3)
BODY, WORN = len(SCENE.body.vertices), len(SCENE.garment.vertices)


def test_the_garment_follows_the_body_in_all_that_counts_vertices():
    cloth = SCENE.layer == CLOTH
    assert cloth.tolist() == [False] * BODY + [True] * WORN
    assert (cloth[SCENE.faces].all(axis=1) | ~cloth[SCENE.faces].any(axis=1)).all()  # no face has corners of both
    np.testing.assert_array_equal(SCENE.faces[-len(SCENE.garment.faces) :] - BODY, SCENE.garment.faces)
    assert SCENE.held[:BODY].all()
    assert np.flatnonzero(SCENE.held[BODY:]).tolist() == sorted(set(SCENE.garment.pinned.tolist()))
    np.testing.assert_array_equal(SCENE.hanging, lengths_along(SCENE.garment.vertices, SCENE.garment.strands))


def test_skin_is_near_the_garment_and_covered_within_its_borders():
    away = np.linalg.norm(SCENE.body.vertices[:, None] - SCENE.garment.vertices, axis=2)
    np.testing.assert_array_equal(SCENE.near_garment, away.min(axis=1) < 0.15)
    ends = {row[row >= 0][end] for row in SCENE.garment.strands for end in (0, -1)}
    inner = ~np.isin(away.argmin(axis=1), list(ends))
    np.testing.assert_array_equal(SCENE.covered[:BODY], SCENE.near_garment & inner)
    assert not SCENE.covered[BODY:].any()


def test_without_the_garment_nothing_is_left_of_it():
    bare = SCENE.bare(SCENE.surface(POSE, scenes.tiny_cloth(SCENE, POSE)))
    alone = SCENE.undressed.surface(POSE, scenes.tiny_cloth(SCENE.undressed, POSE))
    for name in ("vertices", "faces", "edges", "layer"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(alone, name))
    undressed = SCENE.undressed
    assert undressed.undressed is undressed and undressed.warnings == SCENE.warnings
    assert not len(undressed.hanging) and not undressed.near_garment.any() and not undressed.covered.any()


def test_calm_is_no_force_or_the_least_that_a_garment_knows():
    bounds = np.array([[-1.0, 1.0], [0.1, 0.5], [-3.0, -2.0]])
    assert replace(SCENE, garment=replace(SCENE.garment, parameter_bounds=bounds)).neutral_parameters.tolist() == [
        0.0, 0.1, -2.0,
    ]  # fmt: skip


@pytest.mark.parametrize("lacking", ["draper", "garment"])
def test_a_model_without_garment_or_draper_has_no_cloth(lacking):
    whole = scenes.tiny_model(SCENE)
    model = ClothedModel(scene=SCENE) if lacking == "draper" else replace(whole, scene=SCENE.undressed)
    assert whole.clothed and not model.clothed
    assert not len(model.drape(POSE, np.zeros(3), Past()).vertices)
    assert model.drapes(POSE, np.zeros((2, 3)), Past()).shape == (2, 0, 3)
    moves = model.velocity(POSE, scenes.tiny_cloth(SCENE, POSE), np.arange(4, dtype=np.int32), Past())
    np.testing.assert_array_equal(moves, np.zeros((4, 3, 6 + len(POSE.angles))))


def test_several_parameters_on_one_pose_give_what_each_gives():
    model, parameters = scenes.tiny_model(SCENE), np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.2]])
    one, other = model.drapes(POSE, parameters, Past())
    assert np.abs(one - other).max() > 0.01
    for row, laid in zip(parameters, (one, other), strict=True):
        np.testing.assert_allclose(laid, model.drape(POSE, row, Past()).vertices, atol=1e-12)


def test_matches_of_several_matchers_are_pooled_each_with_its_share():
    found = scenes.exact_matches(SCENE.undressed, POSE)
    found = replace(found, weight=np.linspace(0.5, 2, len(found.weight)))
    both = pool([weighted(found, 1.0), weighted(found, 0.5)])
    np.testing.assert_array_equal(both.weight, np.append(found.weight, 0.5 * found.weight))
    np.testing.assert_array_equal(both.vertex, np.tile(found.vertex, 2))
    assert pool([found]) is found and not len(pool([]).weight)
