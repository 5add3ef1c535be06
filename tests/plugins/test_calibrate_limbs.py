"""Limb lengths from silhouettes: exact masks give them back; the derivatives of contour pairs."""

import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from keypoint_recording import DEMO, copy_demo, length, write
from mocapflow_draping.kinematic import Kinematic
from mocapflow_fitting.calibrate_limbs import CalibrateLimbs
from mocapflow_fitting.pose_fit import Solution, velocities
from mocapflow_fitting.proportions import scaled
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_garments.skirt import Skirt
from mocapflow_matching.contour_icp import ContourIcp
from pydantic import ValidationError
from results_scene import make_track

from mocapflow.components import Segmenter
from mocapflow.data import Pose, Segmentation, Silhouette
from mocapflow.errors import RecordingError
from mocapflow.geometry.kinematics import part_of
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.model import ClothedModel, moved
from mocapflow.recordings.recording import open_recording
from mocapflow.results import ViewChecks
from mocapflow.scene import Scene

WRONG = {"thigh": 1.03, "shank": 0.97}  # 12 mm each


@pytest.fixture(scope="module")
def poses(body):
    first, rng = read_pose(DEMO / "init.json", body), np.random.default_rng(5)
    spread = np.where(np.isfinite(body.rest_spread), body.rest_spread, 0.5) * 0.4
    turns = [rng.normal(size=len(spread)) * spread for _ in range(3)]
    return [Pose(root=first.root, angles=np.clip(first.angles + turn, *body.limits.T)) for turn in turns]


def masks_of(body, poses, garment=None):
    """Return a segmenter that knows the truth."""

    class Known(Segmenter):
        name: ClassVar[str] = "known"

        def segment(self, frame, state, past, scene, turn):
            model = ClothedModel(scene=Scene(cameras=scene.cameras, body=body, garment=garment), draper=Kinematic())
            pose = poses[frame.index]
            surface = model.surface(pose, model.drape(pose, model.scene.neutral_parameters, past))
            distances = [model_distance(surface, camera, 12.0) for camera in scene.cameras]
            return Segmentation(
                silhouettes=tuple(Silhouette(camera=c, layer="person", distance=d) for c, d in enumerate(distances))
            )

    return Known()


def from_tape(body):
    tapes = json.loads((DEMO / "subject" / "garment.json").read_text())
    return Skirt(**{f"{name}_m": value for name, value in tapes.items() if name != "type"}, strands=24, rings=8).sew(
        body
    )


@pytest.mark.long
def test_exact_silhouettes_give_the_lengths_back(body, poses, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    cameras = open_recording(folder).cameras
    write(folder, body, poses, cameras, noise_px=0.5)
    stage = CalibrateLimbs(
        segmenter=masks_of(body, poses), matchers=(ContourIcp(spacing_px=2.0),),
        proportions=("thigh", "shank", "girth"), spread=0.05, frames=2, passes=1, rounds=5,
    )  # fmt: skip
    start = Scene(cameras=cameras, body=scaled(body, WRONG))
    fitted = stage.run(open_recording(folder, stop=2), start)
    for ends in (("hip_l", "knee_l"), ("knee_r", "ankle_r")):
        assert abs(length(fitted, *ends) - length(body, *ends)) < 0.003  # m; a pixel is 12 mm


@pytest.mark.long
@pytest.mark.parametrize("shape", [True, False])
def test_exact_silhouettes_give_the_shape_back(body, poses, tmp_path, shape):
    """Of a template that is another person; without its modes limbs and girth can't make that person of it."""
    folder = copy_demo(tmp_path / "recording")
    person, cameras = scaled(body, {"shape_1": 1.5, "shape_2": -2.0}), open_recording(folder).cameras
    write(folder, person, poses, cameras, noise_px=0.5)
    stage = CalibrateLimbs(
        segmenter=masks_of(person, poses), matchers=(ContourIcp(spacing_px=2.0),), shape=shape,
        spread=0.05, frames=2, passes=1, rounds=5,
    )  # fmt: skip
    fitted = stage.run(open_recording(folder, stop=2), Scene(cameras=cameras, body=body))
    before, after = (off(b.vertices - person.vertices) for b in (body, fitted))
    assert before > 0.015  # m
    assert (after < 0.3 * before) == shape


@pytest.mark.long
def test_exact_silhouettes_tell_where_joints_turn(body, poses, tmp_path):
    """Legs that bend show it."""
    folder, away = copy_demo(tmp_path / "recording"), {"hip_forward_m": 0.03, "knee_up_m": -0.02}
    cameras = open_recording(folder).cameras
    write(folder, body, poses, cameras, noise_px=0.5)
    stage = CalibrateLimbs(
        segmenter=masks_of(body, poses), matchers=(ContourIcp(spacing_px=2.0),), proportions=("thigh", "shank"),
        spread=0.05, centre_sd_m=0.02, frames=3, passes=1, rounds=5,
    )  # fmt: skip
    start = scaled(body, away)
    fitted = stage.run(open_recording(folder, stop=3), Scene(cameras=cameras, body=start))
    for name in ("hip_l", "knee_l"):
        true = body.positions[body.joint(name)]
        before, after = (np.linalg.norm(other.positions[other.joint(name)] - true) for other in (start, fitted))
        assert before > 0.019  # m
        assert after < 0.003


def off(difference):
    """Return how far (m, RMS) a mesh is off another, wherever that stands."""
    return np.sqrt(np.mean(np.sum((difference - difference.mean(axis=0)) ** 2, axis=1)))


@pytest.mark.long
def test_clothes_are_laid_on_every_pose_that_is_tried(body, poses, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    cameras, rng = open_recording(folder).cameras, np.random.default_rng(3)
    garment = from_tape(body)
    start = [Pose(root=p.root, angles=p.angles + 0.03 * rng.normal(size=len(p.angles))) for p in poses]
    stage = CalibrateLimbs(
        segmenter=masks_of(body, poses, garment), matchers=(ContourIcp(spacing_px=2.0),), draper=Kinematic(),
        proportions=("thigh", "shank"), spread=0.05, frames=3, passes=1, rounds=5,
    )  # fmt: skip
    wrong = Scene(cameras=cameras, body=scaled(body, WRONG), garment=garment)
    root, angles = np.stack([p.root for p in start]), np.stack([p.angles for p in start])
    track = replace(make_track(root, angles), cloth_parameters=np.tile(wrong.neutral_parameters, (3, 1)))
    fitted = stage.run(open_recording(folder), wrong, None, track)
    for ends in (("hip_l", "knee_l"), ("knee_r", "ankle_r")):
        assert abs(length(fitted, *ends) - length(body, *ends)) < 0.006  # m: half a pixel, half of what was wrong


def test_a_body_without_modes_is_told_of(body, poses, monkeypatch, caplog):
    monkeypatch.setattr("mocapflow_fitting.calibrate_limbs.refine", lambda body, matchers, solution, *_: solution)
    recording, scan = open_recording(DEMO, stop=1), replace(body, shape_modes=None, joint_modes=None)
    track = make_track(np.stack([p.root for p in poses[:1]]), np.stack([p.angles for p in poses[:1]]))
    for shape in (False, True):
        assert "does not know how people differ" not in caplog.text
        stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),), shape=shape, passes=1)
        stage.run(recording, Scene(cameras=recording.cameras, body=scan), None, track)
    assert "does not know how people differ" in caplog.text


def test_views_that_were_found_wrong_do_not_count(body, poses):
    seen = []

    class Watched(Segmenter):
        name: ClassVar[str] = "watched"

        def segment(self, frame, state, past, scene, turn):
            seen.append(frame.usable)
            return Segmentation(silhouettes=())

    stage = CalibrateLimbs(segmenter=Watched(), matchers=(ContourIcp(),), frames=2, passes=1, rounds=1)
    recording = open_recording(DEMO, stop=2)
    scene = Scene(cameras=recording.cameras, body=body)
    track = make_track(np.stack([p.root for p in poses[:2]]), np.stack([p.angles for p in poses[:2]]))
    checks = ViewChecks(frame=np.int32([1]), camera=np.int16([2]), reasons=("the picture shows nothing",))
    stage.run(recording, scene, None, track, checks)
    np.testing.assert_array_equal(seen, [[True] * 4, [True, True, False, True]])


def test_keypoints_of_views_that_were_found_wrong_tell_no_pose(body, poses, tmp_path):
    folder = copy_demo(tmp_path / "recording")
    write(folder, body, poses[:2], open_recording(folder).cameras)
    recording = open_recording(folder, stop=2)
    scene = Scene(cameras=recording.cameras, body=body)
    stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),))
    wrong = ViewChecks(frame=np.int32([0, 0, 0]), camera=np.int16([0, 1, 2]), reasons=("of another time",) * 3)
    assert [list(stage._from_keypoints(recording, scene, checks)[0]) for checks in (None, wrong)] == [[0, 1], [1]]


def test_the_fitted_body_stands_on_the_floor(body, poses, monkeypatch):
    def longer(body, matchers, solution, *_):
        return solution._replace(shared=np.full_like(solution.shared, 0.05))

    monkeypatch.setattr("mocapflow_fitting.calibrate_limbs.refine", longer)
    recording = open_recording(DEMO, stop=1)
    track = make_track(np.stack([p.root for p in poses[:1]]), np.stack([p.angles for p in poses[:1]]))
    stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),), proportions=("shank",), passes=1)
    fitted = stage.run(recording, Scene(cameras=recording.cameras, body=body), None, track)
    assert length(fitted, "knee_l", "ankle_l") > 1.04 * length(body, "knee_l", "ankle_l")
    assert fitted.vertices[:, 2].min() == pytest.approx(body.vertices[:, 2].min(), abs=1e-12)


def test_frames_are_counted_through_all_passes(body, poses, monkeypatch):
    monkeypatch.setattr("mocapflow_fitting.calibrate_limbs.refine", lambda body, matchers, solution, *_: solution)
    told = []
    recording = replace(open_recording(DEMO, stop=2), watch=lambda *count: told.append(count))
    track = make_track(np.stack([p.root for p in poses[:2]]), np.stack([p.angles for p in poses[:2]]))
    stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),), passes=3)
    stage.run(recording, Scene(cameras=recording.cameras, body=body), None, track)
    assert told == [(k, 6) for k in range(1, 7)]


@pytest.mark.parametrize(("good", "looked"), [([1, 4], [1, 4]), ([], [0, 2, 5])])
def test_few_good_frames_are_better_than_bad_ones(body, poses, good, looked):
    track = make_track(np.tile(poses[0].root, (6, 1, 1)), np.tile(poses[0].angles, (6, 1)))
    tried = np.where(track.frame == 0, 0, track.iterations).astype(np.int16)  # the first one is lost
    track = replace(track, doubted=~np.isin(track.frame, [0, *good]), iterations=tried)
    stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),), frames=3)
    assert list(stage._from_track(track)[0]) == looked


@pytest.mark.parametrize(
    ("resting", "whole", "looked"),
    [([0, 1, 2, 5], range(6), [0, 1, 2]), ([1], range(6), [0, 2, 4]), ([], [0, 1, 3, 5], [0, 1, 3]),
     ([1], [], [0, 2, 4])],
)  # fmt: skip
def test_the_best_frames_are_taken_only_where_there_are_enough(body, poses, resting, whole, looked):
    track = make_track(np.tile(poses[0].root, (6, 1, 1)), np.tile(poses[0].angles, (6, 1)))
    usable = track.usable.copy()
    usable[:, 0] = np.isin(track.frame, whole)
    track = replace(track, doubted=track.frame == 5, steady=np.isin(track.frame, resting), usable=usable)
    stage = CalibrateLimbs(segmenter=masks_of(body, poses), matchers=(ContourIcp(),), frames=3)
    assert list(stage._from_track(track)[0]) == looked


def test_velocities_of_skin(body, poses):
    part = part_of(body, np.arange(0, len(body.vertices), 331))
    spreads = {"girth": 0.1, "shank": 0.1, "hip_forward_m": 0.02, "knee_up_m": 0.02, "shape_1": 1.0}
    logs, step = np.array([0.02, -0.03, 0.01, -0.02, 0.5]), 1e-6
    _, moves = velocities(part, poses[0], Solution(spreads, logs, ()))
    for shift in np.random.default_rng(6).normal(size=(4, moves.shape[2])):
        ends = [
            velocities(part, moved(poses[0], s * shift[5:]), Solution(spreads, logs + s * shift[:5], ()))[0]
            for s in (step, -step)
        ]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), moves @ shift, atol=1e-6)


def test_what_may_be_wrong(body, poses):
    scene = Scene(cameras=open_recording(DEMO).cameras, body=body)
    known = masks_of(body, poses)
    with pytest.raises(ValidationError, match="'thigh'.* input_value='tigh'"):
        CalibrateLimbs(segmenter=known, matchers=(ContourIcp(),), proportions=("tigh",))
    with pytest.raises(RecordingError, match="no 2D keypoints"):
        CalibrateLimbs(segmenter=known, matchers=(ContourIcp(),)).run(open_recording(DEMO), scene)
