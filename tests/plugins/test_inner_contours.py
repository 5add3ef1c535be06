"""Edges inside the silhouette: found to a fraction of a pixel where two colours meet, silent where they do not."""

from dataclasses import fields, replace
from functools import partial

import cv2
import matching_scenes
import numpy as np
import pytest
from matching_scenes import FIRST
from mocapflow_levelset import splits
from mocapflow_levelset.colours import BINS, bins_of
from mocapflow_levelset.inner import SIGMA_PX, findable_edges, inner_contours
from mocapflow_levelset.inner_edges import inner_edges
from mocapflow_levelset.layers import COLOURS, colour_model, layer_of
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.inner_contours import InnerContours, slipped
from mocapflow_matching.layered_icp import LayeredIcp, of_another_layer
from test_layers import CLOTHS, SCENE, SKIN, dressed, learned, painted

from mocapflow.data import CLOTH, Change, Cloth, Matches, Past, Pose, Turn, empty_matches
from mocapflow.geometry import twists
from mocapflow.geometry.cameras import magnification, project
from mocapflow.geometry.outfits import together
from mocapflow.geometry.silhouettes import outline
from mocapflow.pooling import pool
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_segmentation

ONE, OTHER = SKIN, CLOTHS
surface_at = partial(matching_scenes.surface_at, scene=SCENE)


def halves(edge, turn=0.0, one=ONE, other=OTHER, noise=0.0):
    """A picture (80, 80) whose colour changes so many px from its middle along a direction, blurred."""
    fine = (np.arange(80 * 8) - 3.5) / 8 - 39.5
    along = np.cos(turn) * fine[None, :] + np.sin(turn) * fine[:, None]
    sharp = np.where((along < edge)[..., None], np.float64(one), np.float64(other))
    image = cv2.GaussianBlur(sharp.reshape(80, 8, 80, 8, 3).mean(axis=(1, 3)), (0, 0), 0.8)
    return np.clip(np.rint(image + noise * np.random.default_rng(1).normal(size=image.shape)), 0, 255).astype(np.uint8)


def found(image, turn=0.0, one=ONE, other=OTHER, reach=12):
    """Where points in the middle, a little apart along the edge, find the end of the part with the first colour."""
    across, at = np.array([np.cos(turn), np.sin(turn)]), np.arange(-12, 12)[:, None]
    pixel = 39.5 + at * [[-across[1], across[0]]]
    normal = np.tile(across, (len(pixel), 1))
    ratio = np.zeros((1, BINS), np.float32)
    for colour, says in ((one, 4), (other, -4)):
        low, high = np.array(colour) - 24, np.array(colour) + 24
        cube = np.stack(np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True))), axis=-1)
        ratio[0, np.unique(bins_of(np.clip(cube, 0, 255).astype(np.uint8)))] += says
    rough = splits.split(
        image, np.ones(image.shape[:2]), ratio, np.zeros(len(pixel), np.int32), pixel, normal, 4.0, reach, 3, 1.0
    )
    return splits.refine(image, pixel, normal, rough, 3)


@pytest.mark.parametrize("edge", [0.0, 0.37, -4.6, 8.25])
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_an_edge_between_two_colours_is_found_to_a_fraction_of_a_pixel(edge, turn):
    offset, variance = found(halves(edge, turn), turn)
    assert np.abs(offset - edge).max() < 0.1
    assert (variance < 0.1**2).all()


def test_noise_scatters_as_the_variance_says():
    offset, variance = found(halves(2.3, noise=6.0))
    assert abs(offset.mean() - 2.3) < 0.1
    assert 0.5 < offset.std() / np.sqrt(variance.mean()) < 2


def test_equal_colours_are_silent():
    assert np.isnan(found(halves(2.0, other=ONE), other=ONE)[0]).all()


def test_an_edge_out_of_reach_is_not_found():
    assert np.isnan(found(halves(11.0), reach=6)[0]).all()


def test_an_edge_the_other_way_round_is_none():
    assert np.isnan(found(halves(2.0, one=OTHER, other=ONE))[0]).all()


def kicked(degrees):
    """A pose whose left leg is raised before the cloth."""
    pose = tiny_pose(SCENE, 1, 0.02)
    angles = pose.angles.copy()
    angles[SCENE.body.screw_names.index("hip_l.flexion")] += np.radians(degrees)
    return Pose(root=pose.root, angles=angles)


def leaning(degrees):
    """A pose whose trunk leans so much farther forward."""
    pose = tiny_pose(SCENE, 1, 0.02)
    lean = twists.exp(twists.screw(np.array([[1.0, 0.0, 0.0]]), pose.root[None, :3, 3])[0] * np.radians(degrees))
    return Pose(root=lean @ pose.root, angles=pose.angles)


def match(colour_of, believed, true=None, slipped_m=0.0):
    """Pairs at a believed pose, of pictures of a true one in which all cloth sits so much lower."""
    pose = kicked(60.0) if true is None else true
    frame, surface = painted(colour_of, pose, lower_m=slipped_m), surface_at(believed)
    past = Past(appearance={COLOURS: learned(frame, pose=pose)})
    segmentation = tiny_segmentation(SCENE, pose)
    layers, known = layer_of(SCENE), colour_model(past)
    told = findable_edges(SCENE, layers, known)
    parts = [
        inner_contours(image, silhouette, surface, camera, layers, told, known, 24)
        for image, silhouette, camera in zip(frame.images, segmentation.silhouettes, SCENE.cameras, strict=True)
    ]
    return InnerContours().match(frame, replace(segmentation, inner=pool(parts)), surface, past, SCENE, FIRST)


def off(matches, pose):
    """How far (M,) px the vertices of matches are from their targets at a pose, along their directions."""
    pixel = np.array([
        project(surface_at(pose).vertices[[v]], SCENE.cameras[c])[0]
        for v, c in zip(matches.vertex, matches.camera, strict=True)
    ])  # fmt: skip
    return np.einsum("ma,ma->m", matches.pixel - pixel, matches.direction)


def test_a_leg_before_the_cloth_is_drawn_to_where_it_is():
    matches = match(dressed, kicked(55.0))
    assert (matches.weight < 1 / SIGMA_PX**2).all()  # noise adds to it
    assert len(matches.vertex) > 20
    skin = SCENE.layer[matches.vertex] != CLOTH
    before, after = (np.abs(off(matches, kicked(degrees))[skin]) for degrees in (55.0, 60.0))
    assert np.median(before) > 1.5
    assert np.median(after) < 0.7


def test_of_the_cloth_only_the_waistband_has_pairs():
    matches, body = match(dressed, kicked(55.0)), len(SCENE.body.vertices)
    cloth = matches.vertex[matches.vertex >= body] - body
    assert len(cloth) > 10
    assert np.isin(cloth, SCENE.garment.pinned).all()


def test_a_waistband_says_how_the_trunk_leans():
    true, believed = leaning(0.0), leaning(4.0)
    matches = match(dressed, believed, true)
    cloth = SCENE.layer[matches.vertex] == CLOTH
    before, after = (np.abs(off(matches, pose)[cloth]) for pose in (believed, true))
    assert np.median(before) > 2 * np.median(after)


def test_edges_of_cloth_and_body_are_sought_only_between_vertices_that_are_asked_for():
    surface, camera = surface_at(kicked(55.0)), SCENE.cameras[0]
    for of in (SCENE.held, SCENE.layer == CLOTH, np.arange(len(SCENE.layer)) % 2 == 0):
        found = inner_edges(surface, camera, 4.0, of)
        assert of[found.vertex].all()
    ends = np.full(len(SCENE.layer), False)
    ends[outline(surface, camera).vertex[:, 0]] = True
    ends[outline(surface, camera).vertex[:, 1]] = False  # no edge has both its ends here
    assert len(inner_edges(surface, camera, 4.0, ends).vertex) == 0


def test_a_slip_is_a_length_so_nearer_cameras_see_more_of_it():
    surface, garment = surface_at(leaning(0.0)), len(SCENE.body.vertices) + SCENE.garment.pinned
    near, back = SCENE.cameras[0], np.eye(4)
    back[2, 3] = 1.5  # m along the line of sight
    far = replace(near, camera_from_world=back @ near.camera_from_world)
    scene, count = replace(SCENE, cameras=(near, far)), len(garment)
    pairs = replace(
        empty_matches(),
        camera=np.repeat(np.array([0, 1], np.int16), count), vertex=np.tile(garment, 2).astype(np.int32),
        pixel=np.zeros((2 * count, 2)), direction=np.zeros((2 * count, 2)), weight=np.ones(2 * count),
    )  # fmt: skip
    size = np.array([magnification(c, surface.vertices[garment].mean(axis=0)) for c in (near, far)]).repeat(count)
    shift = slipped(-0.015 * size, np.zeros(2 * count, np.int32), pairs, surface, scene)
    np.testing.assert_allclose(shift, -0.015 * size, rtol=1e-9)
    assert abs(shift[0] / shift[-1]) > 1.2


def test_garments_slip_each_by_itself():
    twice = replace(SCENE, garment=together("both", [SCENE.garment, SCENE.garment]))
    band, other = SCENE.garment.pinned[:9], len(SCENE.garment.vertices) + SCENE.garment.pinned[:3]
    vertex = np.concatenate([[0, 1], len(SCENE.body.vertices) + np.concatenate([band, other])]).astype(np.int32)
    garment = twice.garment_index[vertex]
    assert garment.tolist() == [-1] * 2 + [0] * 9 + [1] * 3
    pose, away = leaning(0.0), np.repeat([7.0, 3.0, -2.0], [2, 9, 3])
    pairs = replace(
        empty_matches(),
        camera=np.zeros(14, np.int16), vertex=vertex,
        pixel=np.zeros((14, 2)), direction=np.zeros((14, 2)), weight=np.ones(14),
    )  # fmt: skip
    cloth = tiny_cloth(SCENE, pose).vertices
    surface = twice.surface(pose, Cloth(vertices=np.concatenate([cloth, cloth]), parameters=np.zeros(6)))
    np.testing.assert_allclose(slipped(away, garment, pairs, surface, twice), np.where(garment < 0, 0.0, away))
    segmentation = replace(tiny_segmentation(SCENE, pose), inner=pairs)
    found = InnerContours().match(painted(dressed, pose), segmentation, surface, Past(), twice, FIRST)
    assert (found.weight[garment == 1] == 0).all()  # three do not tell a tilt from a height


def test_a_few_pairs_of_a_waistband_tell_nothing():
    whole = match(dressed, leaning(0.0), leaning(0.0))
    cloth = np.flatnonzero(SCENE.layer[whole.vertex] == CLOTH)
    kept = np.setdiff1d(np.arange(len(whole.vertex)), cloth[3:])
    part = Matches(**{each.name: getattr(whole, each.name)[kept] for each in fields(whole)})
    pose = leaning(0.0)
    segmentation = replace(tiny_segmentation(SCENE, pose), inner=part)
    found = InnerContours().match(painted(dressed, pose), segmentation, surface_at(pose), Past(), SCENE, FIRST)
    assert (found.weight[SCENE.layer[found.vertex] == CLOTH] == 0).all()
    assert (found.weight[SCENE.layer[found.vertex] != CLOTH] > 0).all()


def test_a_waistband_that_sits_lower_than_the_tape_says_pulls_at_nothing():
    pose = leaning(0.0)
    slid = match(dressed, pose, pose, slipped_m=0.015)
    cloth = SCENE.layer[slid.vertex] == CLOTH
    assert cloth.sum() > 10
    assert abs(np.median(off(slid, pose)[cloth])) < 0.3
    there = match(dressed, pose, pose)
    assert np.median(slid.weight[cloth]) > 0.5 * np.median(there.weight[SCENE.layer[there.vertex] == CLOTH])


@pytest.mark.parametrize("sigma", [1.0, 1.5])
def test_skin_that_the_garment_covers_at_rest_is_believed_only_where_its_edge_is_near(sigma):
    """The same edge, 6 px off, of a vertex under the garment and of one beyond its hem; of both when it is calm."""
    pose, camera = leaning(0.0), SCENE.cameras[0]
    under, beyond = np.flatnonzero(SCENE.covered)[0], np.flatnonzero(~SCENE.near_garment)[0]
    surface, pair = surface_at(pose), np.array([under, beyond], np.int32)
    across = np.tile([1.0, 0.0], (2, 1))
    inner = replace(
        empty_matches(), camera=np.zeros(2, np.int16), vertex=pair, direction=across,
        weight=np.full(2, sigma**-2), pixel=project(surface.vertices[pair], camera) + 6 * across,
    )  # fmt: skip
    segmentation, frame = replace(tiny_segmentation(SCENE, pose), inner=inner), painted(dressed, pose)
    moved = [Change(body=body, cloth=0.0, angles=0.0, sigmas=1.0) for body in (0.1, 0.001)]
    wide, far, calm = (
        matcher.match(frame, segmentation, surface, Past(), SCENE, Turn(index=1, change=change)).weight
        for matcher, change in (
            (InnerContours(), moved[0]), (InnerContours(covered="far"), moved[0]), (InnerContours(), moved[1]),
        )
    )  # fmt: skip
    off = 6 / sigma
    given_up, held = (2.0**2 / (2.0**2 + off**2)) ** 2 / sigma**2, 2 / off / sigma**2
    assert wide == pytest.approx([given_up, held])
    assert far == pytest.approx([held, held])
    assert calm == pytest.approx([given_up, given_up])


def test_a_leg_of_the_cloth_s_colour_is_left_alone():
    assert len(match(lambda layer: SKIN, kicked(55.0)).vertex) == 0


def test_without_inner_contours_there_are_no_pairs():
    pose = kicked(60.0)
    frame, segmentation = painted(dressed, pose), tiny_segmentation(SCENE, pose)
    assert len(InnerContours().match(frame, segmentation, surface_at(pose), Past(), SCENE, FIRST).vertex) == 0


def test_contours_of_another_part_s_colours_make_no_pair():
    """Cloth and leg both bound the silhouette; painted in each other's colours, every pair is another part's."""
    pose = kicked(60.0)
    frame, segmentation = painted(dressed, pose), tiny_segmentation(SCENE, pose)
    past = Past(appearance={COLOURS: learned(frame, pose=pose)})
    swapped = painted(lambda layer: SKIN if dressed(layer) == CLOTHS else CLOTHS, pose)
    right, wrong = (
        LayeredIcp().match(images, segmentation, surface_at(pose), past, SCENE, FIRST) for images in (frame, swapped)
    )
    assert (right.weight > 0).mean() > 0.95
    assert (wrong.weight > 0).mean() < 0.2
    assert of_another_layer(right, swapped, colour_model(past), layer_of(SCENE), 2.0).mean() > 0.8


def test_before_colours_are_known_all_pairs_count():
    pose = kicked(60.0)
    given = painted(dressed, pose), tiny_segmentation(SCENE, pose), surface_at(pose), Past(), SCENE, FIRST
    found, plain = (matcher.match(*given) for matcher in (LayeredIcp(), ContourIcp()))
    np.testing.assert_array_equal(found.weight, plain.weight)


def test_whose_colours_they_are_needs_the_direction_of_a_contour():
    with pytest.raises(ValueError, match="Input should be 'normal'"):
        LayeredIcp(residual="point")
