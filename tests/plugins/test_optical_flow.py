"""Flow between distance images and between frames: as pairs, and as a guess of the next pose."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from matching_scenes import CALM, FIRST, FRAME, knee_error_deg, seen
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.flow_points import flow_points
from mocapflow_matching.optical_flow import LATER_SHARE, OpticalFlow
from mocapflow_matching.shape_flow import _relax, register
from mocapflow_priors.constant_velocity import ConstantVelocity
from mocapflow_priors.image_flow import ImageFlowPredictor
from mocapflow_priors.joint_limits import JointLimits
from mocapflow_report.raster import Canvas
from mocapflow_sequence.flow import FollowPoints

from mocapflow.assets import Background
from mocapflow.data import CLOTH, NO_CLOTH, Flow, Frame, Matches, Past, Segmentation
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import mask_distance, outline, samples
from mocapflow.model import moved
from mocapflow.testing import tiny_cloth, tiny_past, tiny_pose, tiny_scene

SCENE = tiny_scene()
DRESSED = tiny_scene(clothed=True)
NOTHING = Segmentation(silhouettes=())


def ellipse(shift, turn, size=200):
    """A mask of half axes 12 and 30 px and 200 points on its contour, moved."""
    cos, sin = np.cos(turn), np.sin(turn)
    y, x = np.mgrid[:size, :size] - size / 2
    x, y = x - shift[0], y - shift[1]
    mask = ((cos * x + sin * y) / 12) ** 2 + ((cos * y - sin * x) / 30) ** 2 < 1
    around = 2 * np.pi * np.arange(200) / 200
    points = np.column_stack([12 * np.cos(around), 30 * np.sin(around)]) @ np.array([[cos, sin], [-sin, cos]])
    return mask, points + shift + size / 2


@pytest.mark.parametrize(
    ("shift", "turn", "most"),
    [((8, 0), 0.0, 0.6), ((0, 12), 0.0, 6.4), ((5, 5), 0.35, 6.2), ((0, 0), 0.6, 13.6)],
)
def test_the_flow_of_an_ellipse(shift, turn, most):
    """T-FLOW1: mean error of the correspondences in px, beside that of the closest point."""
    (here, start), (there, end) = ellipse((0, 0), 0.0), ellipse(shift, turn)
    flow = register(mask_distance(here), mask_distance(there), 10.0, 3, 30.0)
    x, y = start.T.astype(np.float32)[:, None]
    reached = start + cv2.remap(flow, x, y, cv2.INTER_LINEAR)[0]
    closest = end[np.linalg.norm(start[:, None] - end[None], axis=2).argmin(axis=1)]
    error, nearest = (np.linalg.norm(p - end, axis=1).mean() for p in (reached, closest))
    print(f"shift {shift} turn {turn}: flow {error:.2f} px, closest point {nearest:.2f} px")
    assert error < most
    assert error < nearest


def test_a_shape_that_stays_has_no_flow():
    distance = mask_distance(ellipse((3, -2), 0.2)[0])
    assert np.abs(register(distance, distance, 1.0, 3, 30.0)).max() < 1e-3


def test_relaxation_ends_where_the_equation_says():
    """g (g . w - wanted) is smoothness times the sum of what the neighbours inside differ by."""
    rng, inside = np.random.default_rng(0), np.ones((12, 14), bool)
    inside[3:5, 6:9] = False
    gx, gy, wanted = rng.normal(size=(3, *inside.shape)).astype(np.float32)
    flow, smoothness = np.zeros((*inside.shape, 2), np.float32), np.float32(3.0)
    for _ in range(60):
        _relax(inside, gx, gy, wanted, smoothness, flow)
    slope, away = np.stack([gx, gy], axis=2), np.zeros(flow.shape)
    for axis in (0, 1):
        step = np.diff(flow, axis=axis) * np.logical_and(*(np.delete(inside, end, axis) for end in (0, -1)))[..., None]
        away += np.diff(step, axis=axis, prepend=0, append=0)
    pull = slope * (np.sum(slope * flow, axis=2) - wanted)[..., None]
    assert np.abs(pull).max() > 0.5
    np.testing.assert_allclose(pull[inside], smoothness * away[inside], atol=1e-4)


def test_targets_lie_on_the_contour_and_the_shift_is_found():
    """The image shows the person 15 cm aside, 20 px: contours ask for the whole shift, along themselves too."""
    truth = tiny_pose(SCENE)
    aside = moved(truth, np.r_[0, 0, 0, 0, 0.15, 0, np.zeros(len(truth.angles))])
    surface, there = (SCENE.surface(pose, NO_CLOTH) for pose in (truth, aside))
    matches = OpticalFlow(between="shapes").match(FRAME, seen(there, SCENE), surface, Past(), SCENE, FIRST)
    assert len(matches.vertex) > 100
    assert not matches.direction.any()
    goals = np.array([project(there.vertices, camera) for camera in SCENE.cameras])[matches.camera, matches.vertex]
    assert np.median(np.linalg.norm(matches.pixel - goals, axis=1)) < 2.0


def test_targets_are_brought_onto_the_contour_of_the_picture_itself():
    """The flow is found on pictures of a third of the size, where a contour is right to a pixel or two of the whole."""
    truth = tiny_pose(SCENE)
    aside = moved(truth, np.r_[0, 0, 0, 0, 0.05, 0, np.zeros(len(truth.angles))])
    surface, there = (SCENE.surface(pose, NO_CLOTH) for pose in (truth, aside))
    shown = seen(there, SCENE)
    matches = OpticalFlow(between="shapes").match(FRAME, shown, surface, Past(), SCENE, FIRST)
    away = []
    for silhouette, camera in zip(shown.silhouettes, SCENE.cameras, strict=True):
        model = samples(outline(surface, camera), surface, camera, 4.0)
        own = matches.camera == silhouette.camera
        for vertex, pixel in zip(matches.vertex[own], matches.pixel[own], strict=True):
            k = np.flatnonzero(model.vertex == vertex)
            if len(k) == 1:  # one point stands for the vertex
                target = pixel + (model.pixel - model.anchor)[k[0]]
                away.append(np.linalg.norm(silhouette.zero_level[0] - target, axis=1).min())
    assert len(away) > 50
    assert np.percentile(away, 90) < 0.6  # what is left is the spacing of the contour's points, a pixel


def test_shapes_lead_the_way_in_the_first_turn_only():
    truth = tiny_pose(SCENE)
    surface = SCENE.surface(truth, NO_CLOTH)
    matcher = OpticalFlow()
    matches = matcher.match(FRAME, seen(surface, SCENE), surface, Past(), SCENE, FIRST)
    assert len(matches.vertex) > 100
    np.testing.assert_allclose(matches.weight, matcher.first_share)  # each is near: its deviation is a pixel
    assert len(matcher.match(FRAME, seen(surface, SCENE), surface, Past(), SCENE, CALM).vertex) == 0


def test_a_model_that_has_left_the_views_has_no_pairs():
    truth = tiny_pose(SCENE)
    away = SCENE.surface(moved(truth, np.r_[0, 0, 0, 0, 0, 50.0, np.zeros(len(truth.angles))]), NO_CLOTH)
    shown = seen(SCENE.surface(truth, NO_CLOTH), SCENE)
    assert len(OpticalFlow(between="shapes").match(FRAME, shown, away, Past(), SCENE, FIRST).vertex) == 0


def test_hanging_cloth_counts_less():
    truth = tiny_pose(DRESSED)
    surface = DRESSED.surface(truth, tiny_cloth(DRESSED, truth))
    shown = seen(surface, DRESSED)
    matches = OpticalFlow(between="shapes", first_share=1.0).match(FRAME, shown, surface, Past(), DRESSED, FIRST)
    cloth = surface.layer[matches.vertex] == CLOTH
    assert cloth.sum() > 20
    assert np.median(matches.weight[cloth]) < 0.1 * np.median(matches.weight[~cloth])


@pytest.mark.long
def test_both_matchers_reach_further_than_nearest_neighbours():
    """T-FLOW1: 10 degrees off, right more often with both than without."""
    alone, both = (
        [knee_error_deg(SCENE, matchers, seed, off_deg=10.0, priors=[JointLimits()]) for seed in range(8)]
        for matchers in ([ContourIcp()], [ContourIcp(), OpticalFlow(between="shapes")])
    )
    print(f"knees, degrees: alone {np.round(alone, 1)}, with flow {np.round(both, 1)}")
    assert np.sum(np.array(both) < 2) > np.sum(np.array(alone) < 2)


def pictures(scene, pose, colours):
    """Pictures of a body whose every vertex has a colour of its own, and an empty room."""
    surface, images = scene.surface(pose, tiny_cloth(scene, pose)), []
    for camera in scene.cameras:
        canvas = Canvas(np.full((camera.size[1], camera.size[0], 3), 0.4, np.float32), camera)
        canvas.draw(surface.vertices, surface.faces, colours[: len(surface.vertices)])
        images.append(np.round(255 * canvas.picture).astype(np.uint8))
    return images


def textured(scene, before, after, index=5):
    """The frame after a motion, with the flow that is found into it."""
    colours = np.random.default_rng(0).uniform(0.1, 1, (2000, 3)).astype(np.float32)
    old, new = pictures(scene, before, colours), pictures(scene, after, colours)
    grey, one, stage = np.full(old[0].shape, 0.4 * 255, np.float32), np.ones(old[0].shape, np.float32), FollowPoints()
    empty = Background(mean=(grey,) * len(old), spread=(one,) * len(old))
    pairs = enumerate(zip(old, new, strict=True))
    flow = tuple(stage.follow(a, b, stage.differs(a, empty, camera)) for camera, (a, b) in pairs)
    return Frame(index=index, time=index / 30, images=tuple(new), usable=np.ones(len(new), bool), flow=flow)


def step(seed, size):
    return size * np.random.default_rng(seed).normal(size=16) * np.r_[np.full(6, 0.3), np.ones(10)]


@pytest.mark.parametrize("scene", [SCENE, DRESSED], ids=["bare", "dressed"])
def test_the_next_pose_follows_the_texture(scene):
    """T-FLOW2: the prediction errs by less than 30 % of the motion between the frames, with no velocity known."""
    shares = []
    for seed in range(4):
        before = tiny_pose(scene, seed)
        after = moved(before, step(seed, 0.1))
        predicted = ImageFlowPredictor().predict(textured(scene, before, after), tiny_past(scene, before), scene)
        points = [SCENE.surface(pose, NO_CLOTH).vertices for pose in (before, after, predicted)]
        motion, error = (np.linalg.norm(p - points[1], axis=1).mean() for p in (points[0], points[2]))
        shares.append(error / motion)
    print(f"error against motion {np.round(shares, 2)}")
    assert max(shares) < 0.3


def test_pairs_from_flow_lie_on_the_surface_of_the_frame_before():
    before = tiny_pose(SCENE)
    after = moved(before, step(1, 0.05))
    frame, past = textured(SCENE, before, after), tiny_past(SCENE, before)
    matches = flow_points(frame, past, SCENE)
    images = [project(SCENE.surface(after, NO_CLOTH).vertices, camera) for camera in SCENE.cameras]
    away = np.linalg.norm(np.array(images)[matches.camera, matches.vertex] - matches.pixel, axis=1)
    assert len(away) > 200
    assert np.median(away) < 0.7


def test_a_lost_view_is_not_used():
    before = tiny_pose(SCENE)
    frame = textured(SCENE, before, before)
    lost = Frame(index=5, time=1 / 6, images=frame.images, usable=np.array([True, False, True, True]), flow=frame.flow)
    assert 1 not in flow_points(lost, tiny_past(SCENE, before), SCENE).camera


def test_a_pose_that_nobody_saw_carries_nothing():
    before = tiny_pose(SCENE)
    past = tiny_past(SCENE, before)
    unseen = replace(past.moments[-1], observed=np.zeros(len(before.angles)))
    assert not len(flow_points(textured(SCENE, before, before), Past(moments=(unseen,)), SCENE).camera)
    assert not len(flow_points(textured(SCENE, before, before), Past(), SCENE).camera)  # nor does a first frame


def test_points_on_cloth_count_less():
    before = tiny_pose(DRESSED)
    frame, past = textured(DRESSED, before, before), tiny_past(DRESSED, before)
    surface = DRESSED.surface(before, tiny_cloth(DRESSED, before))
    matches = OpticalFlow(image_sigma_px=1, first_share=1).match(frame, NOTHING, surface, past, DRESSED, FIRST)
    cloth = surface.layer[matches.vertex] == CLOTH
    assert cloth.sum() > 20
    np.testing.assert_allclose(np.median(matches.weight[cloth]), 0.2)
    np.testing.assert_allclose(np.median(matches.weight[~cloth]), 1.0)
    later = OpticalFlow(image_sigma_px=1, first_share=1).match(frame, NOTHING, surface, past, DRESSED, CALM)
    np.testing.assert_allclose(later.weight, LATER_SHARE * matches.weight)


def test_points_on_cloth_stand_for_the_skin_that_it_touches():
    before = tiny_pose(DRESSED)
    past = tiny_past(DRESSED, before)
    surface = DRESSED.surface(before, past.moments[-1].cloth)
    skin, cloth = np.flatnonzero(surface.layer != CLOTH), np.flatnonzero(surface.layer == CLOTH)
    away = np.linalg.norm(surface.vertices[cloth, None] - surface.vertices[None, skin], axis=2)
    reach = np.median(away.min(axis=1)) + 1e-6
    step = np.array([3.0, -2.0])
    on_cloth = Matches(
        camera=np.zeros(len(cloth), np.int16), vertex=cloth.astype(np.int32), weight=np.ones(len(cloth)),
        pixel=project(surface.vertices[cloth], DRESSED.cameras[0]) + step, direction=np.zeros((len(cloth), 2)),
    )  # fmt: skip
    moved_on = ImageFlowPredictor(touching_mm=1000 * reach).on_skin(on_cloth, past, DRESSED)
    np.testing.assert_array_equal(moved_on.vertex, skin[away.argmin(axis=1)[away.min(axis=1) < reach]])
    image = project(surface.vertices[moved_on.vertex], DRESSED.cameras[0])
    np.testing.assert_allclose(moved_on.pixel, image + step)
    np.testing.assert_allclose(moved_on.weight, 0.2)


def test_without_flow_the_motion_goes_on():
    first, second = tiny_pose(SCENE), moved(tiny_pose(SCENE), step(2, 0.05))
    past = tiny_past(SCENE, first, second)
    frame = Frame(index=5, time=5 / 30, images=(), usable=np.ones(4, bool))
    guess, expected = (p.predict(frame, past, SCENE) for p in (ImageFlowPredictor(), ConstantVelocity()))
    np.testing.assert_array_equal(guess.angles, expected.angles)


def test_flow_of_a_wrong_picture_is_not_followed():
    """Points that contradict each other: the motion goes on as it was."""
    before = tiny_pose(SCENE)
    frame = textured(SCENE, before, before)
    rng = np.random.default_rng(3)
    wild = tuple(
        Flow(pixel=view.pixel, displacement=rng.uniform(-40, 40, view.pixel.shape).astype(np.float32))
        for view in frame.flow
    )
    wrong = Frame(index=5, time=1 / 6, images=frame.images, usable=frame.usable, flow=wild)
    guess = ImageFlowPredictor().predict(wrong, tiny_past(SCENE, before), SCENE)
    assert guess is before


def test_a_few_points_are_not_trusted():
    before = tiny_pose(SCENE)
    frame = textured(SCENE, before, moved(before, step(1, 0.1)))
    few = tuple(Flow(pixel=view.pixel[:7], displacement=view.displacement[:7]) for view in frame.flow)
    assert ImageFlowPredictor().predict(replace(frame, flow=few), tiny_past(SCENE, before), SCENE) is before
