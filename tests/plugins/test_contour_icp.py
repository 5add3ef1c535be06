"""Contour pairs on exact silhouettes of the tiny body, alone and through the loop with the real solver."""

from dataclasses import replace
from functools import partial

import matching_scenes
import numpy as np
import pytest
from matching_scenes import CALM, FIRST, FRAME, Cluttered, cluttered, knee_error_deg, seen
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.robust import robust_weights

from mocapflow.data import CLOTH, NO_CLOTH, Past, Pose, Segmentation
from mocapflow.geometry.cameras import project
from mocapflow.geometry.silhouettes import occluding_contour
from mocapflow.testing import tiny_pose, tiny_scene

SCENE = tiny_scene()
DRESSED = tiny_scene(clothed=True)
STARTS = range(6)
surface_at = partial(matching_scenes.surface_at, scene=SCENE)


@pytest.fixture(scope="module")
def truth():
    return tiny_pose(SCENE)


def match(matcher, surface, segmentation, turn=FIRST, scene=SCENE):
    return matcher.match(FRAME, segmentation, surface, Past(), scene, turn)


def raised(pose, metres):
    root = pose.root.copy()
    root[2, 3] += metres
    return Pose(root=root, angles=pose.angles)


def along(surface, matches, scene=SCENE):
    """How far (M,) px each matched vertex has to move along its direction."""
    views = np.array([project(surface.vertices, camera) for camera in scene.cameras])
    return np.sum((matches.pixel - views[matches.camera, matches.vertex]) * matches.direction, axis=1)


def test_at_the_true_pose_nothing_has_to_move(truth):
    surface = surface_at(truth)
    matches = match(ContourIcp(), surface, seen(surface, SCENE))
    away = np.abs(along(surface, matches))
    assert np.percentile(away, 90) < 0.1
    assert away.max() < 4.0 * np.sqrt(2)  # at the rim of a sole: neighbours round a corner, 4 px apart
    contour_px = sum(len(s.zero_level[0]) for s in seen(surface, SCENE).silhouettes) * np.pi / 4
    assert len(matches.vertex) == pytest.approx(2 * contour_px / 4.0, rel=0.1)  # both ways, every 4 px


def test_the_chapters_pairs_weigh_one_or_nothing():
    """By the settings of pipelines/paper.yaml: skin and cloth alike, stray points out."""
    body = tiny_pose(DRESSED)
    surface = matching_scenes.surface_at(body, DRESSED)
    chapters = ContourIcp(
        residual="point", first_loss="zhang", later_loss="zhang", scale=6.0, cloth_sigma_px_per_m=0.0, hem_guard_px=0.0
    )
    matches = match(chapters, surface, cluttered(seen(surface, DRESSED), 0.25, 0), scene=DRESSED)
    assert surface.cloth[matches.vertex].any() and not surface.cloth[matches.vertex].all()
    assert set(matches.weight) == {0.0, 1.0}


@pytest.mark.parametrize("residual", ["normal", "point"])
def test_a_shift_is_asked_for_along_the_normals(truth, residual):
    """The image shows the person 3 cm higher: 4 px; only contours that look up or down can tell."""
    low = surface_at(truth)
    matches = match(ContourIcp(residual=residual, first_loss="none"), low, seen(surface_at(raised(truth, 0.03)), SCENE))
    views = np.array([project(low.vertices, camera) for camera in SCENE.cameras])
    wanted = matches.pixel - views[matches.camera, matches.vertex]
    if residual == "point":
        assert not matches.direction.any()
        assert np.median(wanted[:, 1]) < 0  # up, but sideways contours stay: their nearest point is beside them
    else:
        np.testing.assert_allclose(np.linalg.norm(matches.direction, axis=1), 1)
        flat = np.abs(matches.direction[:, 1]) > 0.95
        upward = -np.sign(matches.direction[flat, 1]) * along(low, matches)[flat]
        assert np.median(upward) == pytest.approx(4.0, abs=0.5)
        level = np.abs(matches.direction[:, 1]) < 0.03
        assert np.percentile(np.abs(along(low, matches)[level]), 80) < 0.2


def test_forward_and_backward_make_both(truth):
    surface, segmentation = surface_at(truth), seen(surface_at(raised(truth, 0.03)), SCENE)
    forward, backward, both = (
        len(match(ContourIcp(direction=way), surface, segmentation).vertex) for way in ("forward", "backward", "both")
    )
    assert forward + backward == both
    assert min(forward, backward) > 0.4 * both


def test_the_reach_narrows_once_the_body_is_calm(truth):
    surface, segmentation = surface_at(truth), seen(surface_at(raised(truth, 0.12)), SCENE)
    first, later = (match(ContourIcp(), surface, segmentation, turn) for turn in (FIRST, CALM))
    assert np.abs(along(surface, first)).max() > 12
    assert np.abs(along(surface, later)).max() < 10 + 3  # a pixel lies up to an edge's length from its vertex's anchor
    assert len(later.vertex) < len(first.vertex)


def test_a_frame_that_began_far_off_is_calm_later(truth):
    surface, segmentation = surface_at(truth), seen(surface_at(raised(truth, 0.12)), SCENE)
    moved = replace(CALM, change=replace(CALM.change, body=0.03))
    icp = ContourIcp(calm_mm=40)
    near, far = (match(icp, surface, segmentation, turn) for turn in (moved, replace(moved, far=True)))
    assert len(near.vertex) < len(far.vertex)
    still = match(icp, surface, segmentation, replace(CALM, far=True))
    assert len(still.vertex) == len(near.vertex)
    strict, slow = ContourIcp(calm_mm=5), replace(moved, change=replace(CALM.change, body=0.01))
    for turn in (slow, replace(slow, far=True)):  # it never makes a turn calmer
        assert len(match(strict, surface, segmentation, turn).vertex) == len(far.vertex)


@pytest.mark.parametrize("sigma", [1.0, 2.5])
def test_the_loss_gives_way_to_a_redescending_one_once_the_body_is_calm(truth, sigma):
    surface, segmentation = surface_at(truth), seen(surface_at(raised(truth, 0.05)), SCENE)
    for turn, loss in ((FIRST, "huber"), (CALM, "geman_mcclure")):
        matches = match(ContourIcp(sigma_px=sigma), surface, segmentation, turn)
        expected = robust_weights(np.abs(along(surface, matches)) / sigma, loss, 2.0) / sigma**2
        np.testing.assert_allclose(matches.weight, expected, atol=1e-9)


def test_pairs_whose_normals_disagree_are_none(truth):
    """Stray points on the contour that face inward find nobody, but for some in the narrow gap between the legs."""
    surface = surface_at(truth)
    clean = seen(surface, SCENE).silhouettes[0]
    pixel, normal = clean.zero_level
    strange = Cluttered(camera=0, layer="person", distance=clean.distance, stray=pixel, outward=-normal)
    for angle, share in ((60, 1.0), (180, 2.0)):
        matcher = ContourIcp(spacing_px=1.0, direction="forward", first_reach_px=5.0, normal_angle_deg=angle)
        pairs = matcher.match_view(strange, surface, SCENE, FIRST)
        assert len(pairs.vertex) == pytest.approx(share * len(pixel), rel=0.05)


def test_hanging_cloth_counts_less(truth):
    """The sigma of a pair grows with the length from which its cloth hangs."""
    surface = surface_at(truth, scene=DRESSED)
    matches = match(
        ContourIcp(first_loss="none", hem_guard_px=0, cloth_sigma_px_per_m=30),
        surface,
        seen(surface, DRESSED),
        scene=DRESSED,
    )
    cloth = surface.layer[matches.vertex] == CLOTH
    assert cloth.sum() > 50
    hanging = DRESSED.hanging[matches.vertex[cloth] - len(DRESSED.body.vertices)]
    np.testing.assert_allclose(matches.weight[cloth] ** -0.5, 1 + 30 * hanging)
    np.testing.assert_allclose(matches.weight[~cloth], 1)


def test_pairs_on_cloth_reach_less_far(truth):
    """Of the same pairs those on cloth that are farther apart are left out, those on skin stay."""
    surface, aside = surface_at(truth, scene=DRESSED), np.array([0.03, 0.02, 0.0])
    moved = replace(surface, vertices=surface.vertices + aside)
    every, few = (
        match(ContourIcp(cloth_reach_px=reach), moved, seen(surface, DRESSED), scene=DRESSED)
        for reach in (float("inf"), 3.0)
    )
    cloth, kept = moved.cloth[every.vertex], moved.cloth[few.vertex]
    image = np.array([
        project(moved.vertices[[v]], DRESSED.cameras[c])[0]
        for v, c in zip(every.vertex[cloth], every.camera[cloth], strict=True)
    ])  # fmt: skip
    near = np.linalg.norm(every.pixel[cloth] - image, axis=1) <= 3.0
    assert 10 < near.sum() < 0.8 * len(near)
    assert kept.sum() == near.sum()
    assert np.array_equal(few.vertex[~kept], every.vertex[~cloth])
    assert np.array_equal(few.pixel[kept], every.pixel[cloth][near])


def test_skin_beside_a_hem_counts_as_the_cloth_there(truth):
    """Skin within 12 px of a cloth contour and near the garment at rest has the sigma of the nearest cloth."""
    surface = surface_at(truth, scene=DRESSED)
    matches = match(
        ContourIcp(first_loss="none", hem_guard_px=12, cloth_sigma_px_per_m=30),
        surface,
        seen(surface, DRESSED),
        scene=DRESSED,
    )
    near = np.append(DRESSED.near_garment, np.zeros(len(DRESSED.hanging), bool))
    checked = []
    for number, camera in enumerate(DRESSED.cameras):
        contour = occluding_contour(surface, camera, 4.0)
        cloth = np.flatnonzero(surface.layer[contour.vertex] == CLOTH)
        away = np.linalg.norm(contour.pixel[:, None] - contour.pixel[None, cloth], axis=2)
        beside = near[contour.vertex] & (away.min(axis=1) < 12)
        hanging = DRESSED.hanging[contour.vertex[cloth[away.argmin(axis=1)]] - len(DRESSED.body.vertices)]
        expected = (1 + 30 * np.where(beside, hanging, 0)) ** -2
        for k in np.flatnonzero(np.bincount(contour.vertex)[contour.vertex] == 1):  # one point stands for the vertex
            weight = matches.weight[(matches.camera == number) & (matches.vertex == contour.vertex[k])]
            if surface.layer[contour.vertex[k]] != CLOTH:
                np.testing.assert_allclose(weight, expected[k])
                checked.append(beside[k])
    assert np.sum(checked) > 10
    assert np.sum(~np.array(checked)) > 30


def test_five_degrees_off_is_found_to_less_than_one():
    """T-ICP4, the first row of the table: 5 degrees and 7 mm off, pairs both ways."""
    assert max(knee_error_deg(SCENE, [ContourIcp()], seed) for seed in STARTS) < 1.0


@pytest.mark.long
def test_clutter():
    """T-ICP2, a quarter of stray points in every contour; plain least squares is led astray by them."""
    plain = ContourIcp(first_loss="none", later_loss="none")
    robust = np.array([knee_error_deg(SCENE, [ContourIcp()], seed, clutter=0.25) for seed in STARTS])
    squares = np.array([knee_error_deg(SCENE, [plain], seed, clutter=0.25) for seed in STARTS])
    print(f"worst knee, degrees: ours {robust.round(2)}, plain least squares {squares.round(2)}")
    assert robust.max() < 2.0
    assert np.median(robust) < 1.0
    assert squares.max() > 5.0
    assert (squares > 5 * robust).all()


def test_a_redescending_loss_from_the_first_turn_gives_up_a_leg():
    """Why there is a schedule: the limb that is furthest off counts as clutter."""
    early = ContourIcp(first_loss="geman_mcclure")
    assert max(knee_error_deg(SCENE, [early], seed, clutter=0.25) for seed in STARTS) > 2.0


def test_the_clutter_is_where_it_should_be(truth):
    clean = seen(surface_at(truth), SCENE)
    for before, after in zip(clean.silhouettes, cluttered(clean, 0.25, seed=0).silhouettes, strict=True):
        assert len(after.zero_level[0]) == pytest.approx(1.25 * len(before.zero_level[0]), abs=1)
        assert (np.diff(after.zero_level[0][:, 1]) >= 0).all()


def test_without_silhouettes_there_is_nothing_to_match(truth):
    assert len(match(ContourIcp(), SCENE.surface(truth, NO_CLOTH), Segmentation(silhouettes=())).vertex) == 0


def test_what_a_garment_covers_ends_at_its_borders():
    """Skin is covered between waistband and hem of the pattern, near it a little beyond; a bare body is neither."""
    assert not SCENE.covered.any() and not SCENE.near_garment.any()
    body, rows = DRESSED.body.vertices, DRESSED.garment.vertices[DRESSED.garment.strands]
    low, high = rows[:, -1, 2].max(), rows[:, 0, 2].min()
    covered = DRESSED.covered[: len(body)]
    assert covered.any() and (DRESSED.near_garment & ~covered).any() and not DRESSED.covered[len(body) :].any()
    assert (body[covered, 2] < high).all() and (body[covered, 2] > low).all()


@pytest.mark.parametrize("spacing_px", [1.0, 3.0, 4.0, 5.0, 6.0, 10.0, 40.0])
def test_points_are_taken_alike_from_all_contours_of_a_row(spacing_px):
    """Three limbs abreast: six contours."""
    matcher, contour = ContourIcp(spacing_px=spacing_px), np.tile(np.arange(6), 300)
    taken = np.bincount(contour[:: matcher.stride], minlength=6)
    assert taken.max() - taken.min() <= 1
    assert matcher.stride == pytest.approx(4 / np.pi * spacing_px, abs=2.0)


@pytest.mark.parametrize("shift_px", [(110, 0), (0, -80)])
def test_a_contour_that_leaves_the_image_finds_no_pair_there(truth, shift_px):
    """At the true pose; near the border the image has no contour, and the nearest one is elsewhere."""
    moved = np.zeros((3, 3))
    moved[:2, 2] = shift_px
    cameras = tuple(replace(camera, intrinsics=camera.intrinsics + moved) for camera in SCENE.cameras)
    scene, surface = replace(SCENE, cameras=cameras), surface_at(truth)
    matches = match(ContourIcp(first_loss="none"), surface, seen(surface, scene), scene=scene)
    place = np.array([project(surface.vertices, camera) for camera in cameras])[matches.camera, matches.vertex]
    near = np.any((place < 12) | (place > np.array(cameras[0].size) - 13), axis=1)
    assert near.sum() > 10
    assert np.abs(along(surface, matches, scene))[near].max() < 1.0


def test_where_a_partial_body_was_cut_off_nothing_is_matched(truth):
    """The image shows the whole person, and their contour passes the cut: what is paired there would hold the body."""
    whole = surface_at(truth)
    at_rest = SCENE.body.vertices[:, 2]
    rim = at_rest > np.quantile(at_rest, 0.9)
    partial = replace(SCENE, body=replace(SCENE.body, cut=rim))
    usual, cut = (match(ContourIcp(), whole, seen(whole, SCENE), scene=scene) for scene in (SCENE, partial))
    assert rim[usual.vertex].sum() > 20
    assert sorted(cut.vertex) == sorted(usual.vertex[~rim[usual.vertex]])
