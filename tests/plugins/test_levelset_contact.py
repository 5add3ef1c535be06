"""Where the body meets the floor, both sides of its contour are dark."""

from dataclasses import replace

import numpy as np
from mocapflow_levelset.channels import features
from mocapflow_levelset.contact import NEAR_M, contact_zone
from mocapflow_levelset.evolve import Schedule
from mocapflow_levelset.levelset import LevelSet
from mocapflow_levelset.redistance import redistance
from mocapflow_levelset.statistics import Window
from mocapflow_levelset.view import Contact, View, find

from mocapflow.geometry.cameras import project
from mocapflow.testing import scenes

SIZE, EDGE = 160, 100  # px; row of the sole
SOCK, FLOOR = np.array([150.0, 158.0, 165.0]), np.array([190.0, 170.0, 140.0])  # BGR, alike in brightness


def standing():
    """Return a picture (H, W, 3) of a light sock on a light floor, dark where they meet, and its outline."""
    import cv2

    rng = np.random.default_rng(4)
    row, column = np.mgrid[:SIZE, :SIZE]
    inside = (row < EDGE) & (np.abs(column - 80) < 30) & (row > 40)
    shade = 1 - 0.55 * np.exp(-0.5 * ((row - EDGE) / 4.0) ** 2) * (np.abs(column - 80) < 34)
    shade = np.where(inside, shade, np.where(row > EDGE, 1 - 0.5 * np.exp(-(row - EDGE) / 12.0), 1.0))
    colour = np.where(inside[..., None], SOCK, FLOOR) * shade[..., None]
    image = cv2.GaussianBlur(colour, (0, 0), 0.7) + rng.normal(0, 2, colour.shape)
    outline = np.where(inside, np.float32(0.5), np.float32(-0.5))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), redistance(outline, 12.0)


def sole(steps):
    """Return the mean row at which the sole is found, from a model that stands 2 px too high."""
    image, true = standing()
    model = np.roll(true, -2, axis=0)
    row, column = np.mgrid[:SIZE, :SIZE]
    zone = (np.abs(row - EDGE) < 8) & (np.abs(column - 80) < 24)
    contact = Contact(zone, Schedule(steps, 4, 4), Window(12.0, 8, 0.03)) if steps else None
    segmenter = LevelSet(use_background=False, shape_weight=0.01)
    view = View(image=image, start=model, prior=model, counted=np.ones(model.shape, bool), contact=contact)
    level = find(view, segmenter._resolutions(warm=False), segmenter._method()).level
    return np.mean([EDGE - 20 + np.flatnonzero(level[EDGE - 20 :, x] < 0)[0] for x in range(65, 96)]) - 0.5


def test_a_sole_in_its_own_shadow_is_found_by_its_colour():
    """By brightness the contour runs where light gives way to dark, inside the foot."""
    assert sole(0) < EDGE - 0.5 - 1.0
    assert abs(sole(20) - (EDGE - 0.5)) < 0.5


def test_chromaticity_hardly_sees_a_shadow():
    """In half the light (0.73 of the grey levels) chromaticities stay, lightness moves by less than the floor."""
    lit = np.array([[[190, 170, 140]]], np.uint8)
    planes = [features(np.rint(lit * k).astype(np.uint8), ("chromaticity",))[:, 0, 0] for k in (1.0, 0.73)]
    light, *chroma = np.abs(planes[0] - planes[1])
    assert light < 0.03
    assert max(chroma) < 0.01
    assert np.abs(features(lit[..., ::-1].copy(), ("chromaticity",))[1:, 0, 0] - planes[0][1:]).max() > 0.1


def test_the_zone_lies_below_what_is_lowest():
    scene = scenes.tiny_scene()
    pose = scenes.tiny_pose(scene, 3, 0.1)
    surface = scene.surface(pose, scenes.tiny_cloth(scene, pose))
    camera = scene.cameras[0]
    zone = contact_zone(surface, camera)
    height = surface.vertices[:, 2]
    low = project(surface.vertices[height < height.min() + NEAR_M], camera)
    row, column = np.nonzero(zone)
    assert len(row)
    distance = np.linalg.norm(np.stack([column, row], axis=1)[:, None] - low[None], axis=2).min(axis=1)
    assert distance.max() < 6 + 4  # the outline may lie between vertices
    jumping = replace(surface, vertices=surface.vertices + [0, 0, 0.3])
    assert contact_zone(jumping, camera).any()
    assert not contact_zone(surface, camera)[: int(project(surface.vertices, camera)[:, 1].min())].any()
