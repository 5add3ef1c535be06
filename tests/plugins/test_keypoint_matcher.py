"""Keypoints paired with the landmarks of a body: where they stand, who is meant, and how far they are trusted."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from keypoint_recording import DEMO, bystander_of, keypoints
from mocapflow_bodies.scanned import Scanned
from mocapflow_fitting.landmarks import landmarks
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_matching.keypoints import Keypoints, _median_error, marks_on
from mocapflow_twist.twist_gauss_newton import TwistGaussNewton

from mocapflow.data import NO_CLOTH, Frame, Past, Segmentation, Turn
from mocapflow.errors import RecordingError
from mocapflow.geometry import kinematics
from mocapflow.geometry.cameras import centre, project
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.model import ClothedModel, moved
from mocapflow.prediction import initial_state
from mocapflow.scene import Scene

BODY = Scanned().load(DEMO)
SCENE = Scene(cameras=read_cameras(DEMO), body=BODY)
POSE = read_pose(DEMO / "init.json", BODY)
NOTHING = Segmentation(silhouettes=())
FIRST = Turn(index=0)


def frame_of(pose, noise_px=0.0, bystander=(), wild=(), seed=0):
    """A frame with keypoints of a pose, of a bystander in some views (listed first), and with some points astray."""
    rng, views = np.random.default_rng(seed), []
    for index, camera in enumerate(SCENE.cameras):
        people = [keypoints(BODY, pose, camera, rng, noise_px, confidence=1.0)]
        for row in wild:
            people[0][row, :2] += rng.normal(scale=60, size=2)
        if index in bystander:
            people.insert(0, keypoints(BODY, bystander_of(pose), camera, rng, noise_px))
        views.append(np.stack(people))
    usable = np.ones(len(views), bool)
    return Frame(index=0, time=0.0, images=(), usable=usable, keypoints=tuple(views))


def match(frame, pose=POSE, matcher=None):
    return (matcher or Keypoints()).match(frame, NOTHING, SCENE.surface(pose, NO_CLOTH), Past(), SCENE, FIRST)


def away(matches):
    """How far (M,) px each vertex of the true pose has to move."""
    vertices = SCENE.surface(POSE, NO_CLOTH).vertices
    image = np.stack([project(vertices, camera) for camera in SCENE.cameras])
    return np.linalg.norm(matches.pixel - image[matches.camera, matches.vertex], axis=1)


@pytest.mark.parametrize("by", [0.0, 0.4])
def test_landmarks_are_means_of_the_skin_around_them(by):
    """At rest and bent, within what the skin slides over a joint."""
    pose = moved(POSE, np.r_[np.zeros(6), by * np.random.default_rng(0).normal(size=len(POSE.angles))])
    places, marks = landmarks(BODY), marks_on(BODY)
    exact = kinematics.skin(places.body, kinematics.chain(places.body, pose)[0], pose.angles)
    skin = SCENE.surface(pose, NO_CLOTH).vertices
    means = np.einsum("lk,lka->la", marks.share, skin[marks.vertex])
    np.testing.assert_allclose(marks.share.sum(axis=1), 1)
    assert (marks.share >= 0).all()
    off = np.linalg.norm(means - exact, axis=1)
    assert np.median(off) < 0.01
    assert off.max() < 0.04


@pytest.mark.parametrize(("layout", "points"), [("coco_17", 17), ("halpe_26", 26)])
def test_keypoints_that_a_layout_does_not_have_are_refused(layout, points):
    with pytest.raises(RecordingError, match=f"a person has 25 keypoints, in the layout {layout} {points}"):
        match(frame_of(POSE), matcher=Keypoints(layout=layout))


def test_at_the_true_pose_nothing_has_to_move_much():
    matches = match(frame_of(POSE))
    assert np.median(away(matches)) < 1.0
    assert set(matches.camera) == {0, 1, 2, 3}


def test_the_pose_is_found_from_keypoints_alone():
    """Ten degrees off: the landmarks come back to where they are seen."""
    start = moved(POSE, np.r_[np.zeros(6), np.radians(10) * np.random.default_rng(1).normal(size=len(POSE.angles))])
    frame, model = frame_of(POSE, noise_px=0.3), ClothedModel(scene=SCENE)
    pose = start
    for index in range(3):
        state, turn = initial_state(pose, np.empty(0), NO_CLOTH), Turn(index=index)
        again = partial(Keypoints().match, frame, NOTHING, past=Past(), scene=SCENE, turn=turn)
        pose = TwistGaussNewton().solve(again, state, model, (), Past(), turn).pose
    places = landmarks(BODY).body
    truth, before, after = (
        kinematics.skin(places, kinematics.chain(places, p)[0], p.angles) for p in (POSE, start, pose)
    )
    assert np.linalg.norm(before - truth, axis=1).mean() > 0.05
    assert np.linalg.norm(after - truth, axis=1).mean() < 0.01


def test_a_bystander_is_not_meant():
    alone, crowded = match(frame_of(POSE)), match(frame_of(POSE, bystander=(0, 2)))
    np.testing.assert_allclose(crowded.pixel, alone.pixel)


def test_a_landmark_behind_the_camera_says_nothing_of_the_others():
    points = np.array([[10.0, 20, 1], [30, 40, 1], [50, 60, 1], [0, 0, 0], [0, 0, 0]])  # two were not seen
    projected = np.array([[13.0, 24], [np.nan, np.nan], [50, 65], [40, 80], [90, 9]])
    assert _median_error(points, projected) == 5.0
    assert _median_error(points, np.full((5, 2), np.nan)) == np.inf


def test_somebody_far_away_is_not_taken():
    other = moved(POSE, np.r_[0, 0, 0, 1.5, 0, 0, np.zeros(len(POSE.angles))])
    assert len(match(frame_of(other)).vertex) == 0


def test_the_weight_is_learned_from_the_reprojection():
    """Keypoints that contradict each other by more count for less; the estimate is right where they are good."""
    quiet, noisy = (match(frame_of(POSE, noise_px=px)).weight.sum() for px in (0.5, 12.0))
    assert noisy < 0.3 * quiet
    for px in (2.0, 4.0, 8.0):
        estimates = []
        for seed in range(10):
            seen = np.stack([view[0] for view in frame_of(POSE, noise_px=px, seed=seed).keypoints])
            estimates.append(Keypoints()._estimator_px(seen, SCENE.cameras))
        assert np.mean(estimates) == pytest.approx(px, rel=0.1), estimates


def test_a_landmark_pulls_once_however_many_vertices_stand_for_it():
    """The estimator is exact, so it is trusted to a pixel; the landmark may be off by its spread, seen from there."""
    marks = marks_on(BODY)
    places = np.einsum("lk,lka->la", marks.share, SCENE.surface(POSE, NO_CLOTH).vertices[marks.vertex])
    matches = match(frame_of(POSE), matcher=Keypoints(scale=1e6, least_sigma_px=1.0))
    for index, camera in enumerate(SCENE.cameras):
        spread = camera.intrinsics[0, 0] * marks.spread / np.linalg.norm(places - centre(camera), axis=1)
        assert matches.weight[matches.camera == index].sum() == pytest.approx((1 / (1 + spread**2)).sum())


def test_two_views_do_not_tell_how_good_keypoints_are():
    """Then they are as good as is set."""
    frame = replace(frame_of(POSE), usable=np.array([True, True, False, False]))
    one, other = (match(frame, matcher=Keypoints(sigma_px=sigma, scale=1e6)).weight for sigma in (50.0, 100.0))
    np.testing.assert_allclose(one, 4 * other, rtol=0.1)  # the landmarks' own spread adds to it


def test_no_confidence_is_above_one_or_below_zero():
    def weights(confidence):
        views = frame_of(POSE).keypoints
        told = [np.where(view[..., 2:] > 0, [1, 1, confidence], 1.0) * view for view in views]
        return match(replace(frame_of(POSE), keypoints=tuple(told))).weight

    np.testing.assert_array_equal(weights(3.0), weights(1.0))
    assert len(weights(-1.0)) == 0


def test_points_astray_pull_little():
    matches, clean = match(frame_of(POSE, wild=(11,))), match(frame_of(POSE))
    np.testing.assert_array_equal(matches.vertex, clean.vertex)
    wild = away(matches) > 30
    assert wild.any()
    assert (matches.weight[wild] < 0.5 * clean.weight[wild]).all()


def test_no_keypoints_no_pairs():
    frame = frame_of(POSE)
    assert len(match(replace(frame, keypoints=None)).vertex) == 0
    assert len(match(replace(frame, keypoints=tuple(np.empty((0, 0, 3)) for _ in frame.keypoints))).vertex) == 0
    assert len(match(replace(frame, keypoints=tuple(np.zeros((1, 25, 3)) for _ in frame.keypoints))).vertex) == 0
    lost = replace(frame, usable=np.array([True, False, True, True]))
    assert set(match(lost).camera) == {0, 2, 3}
