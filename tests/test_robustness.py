"""Spoiled images, end to end: wrong frames (T-EXP4), disturbed scissors (T-EXP5), unseen limbs (T-EXP2, T-EXP6)."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import turning_person
from mocapflow_priors.density import log_density, read
from mocapflow_priors.parzen import SHIPPED

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import NO_CLOTH, Moment, Past, Start
from mocapflow.geometry import twists
from mocapflow.geometry.cameras import project
from mocapflow.help.shipped import shipped
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import open_recording
from mocapflow.timing import Stopwatch
from mocapflow.track import TIMED, CoupledLoop

MOCAPFLOW = Path(sys.executable).with_name("mocapflow")
CLIP = shipped("examples", "data", "skirt_steps")
WRONG = {12: "does not fit", 13: "does not fit", 14: "does not fit", 20: "does not fit", 21: "does not fit"}
BACK = 3  # frames after wrong ones, by which the pose is right again


LEGS = [f"{joint}_{side}" for joint in ("knee_flexion", "hip_flexion", "ankle") for side in "lr"]


ELBOWS = ["elbow_l", "elbow_r"]


def tracked(out, pipeline, *more, names=LEGS, clip=CLIP):
    """Run without pictures and return the errors of angles (T, K) degrees, the angles themselves and run.json."""
    quick = [word for stage in ("overlay", "virtual") for word in ("--set", f"stages.{stage}=null")]
    command = [MOCAPFLOW, "run", shipped("pipelines", pipeline), "--recording", clip, "--out", out, *quick, *more]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    with (out / "results" / "angles.csv").open() as mine, (clip / "truth" / "angles.csv").open() as true:
        rows = [[[float(row[name]) for name in names] for row in csv.DictReader(file)] for file in (mine, true)]
    found, truth = np.array(rows[0]), np.array(rows[1][: len(rows[0])])
    return np.abs(found - truth), found, json.loads((out / "run.json").read_text())


@pytest.mark.long
def test_wrong_frames_are_named_and_the_pose_is_right_soon_after(tmp_path):
    errors, _, told = tracked(tmp_path / "run", "corrupted.yaml", "--frames", "0:26", "--set", "stages.smooth=null")
    assert told["frames"]["lost"] == list(WRONG)
    notes = {frame["frame"]: " ".join(frame.get("notes", [])) for frame in told["per_frame"]}
    assert all(why in notes[index] for index, why in WRONG.items())
    error = np.sqrt(np.mean(errors**2, axis=1))
    limit = max(1.5 * np.median(error[2:12]), np.median(error[2:12]) + 1)
    assert error[14 + BACK] < limit and error[21 + BACK] < limit


@pytest.mark.long
def test_after_a_second_without_pictures_the_person_is_found_within_five_frames(tmp_path):
    """A knee was moving when the pictures ended; it does not move on, and the next picture begins anew."""
    dropped = "stages.corrupt before background={use: corrupt, events: [{what: dropped, first: 12, count: 30}]}"
    unsmoothed = ("--set", "stages.smooth=null", "--frames", "0:50")
    errors, angles, told = tracked(tmp_path / "run", "skirt.yaml", "--set", dropped, *unsmoothed, names=LEGS + ELBOWS)
    assert told["frames"]["lost"] == list(range(12, 42))
    assert np.abs(angles[12:42] - angles[11]).max() < 60
    assert errors[42 + 5 :].max() < 8
    assert "begun anew" in " ".join(told["per_frame"][42]["notes"])


@pytest.mark.long
def test_legs_that_nobody_sees_do_not_jump_and_are_found_where_they_are(tmp_path):
    """A knee is raised by 100 degrees meanwhile: smoothing leads it there, backwards in time."""
    covered = "stages.corrupt before background={use: corrupt, events: [{what: covered, first: 4, count: 10}]}"
    errors, legs, _ = tracked(tmp_path / "run", "skirt.yaml", "--frames", "0:18", "--set", covered)
    assert np.abs(np.diff(legs, axis=0)).max() < 30
    assert errors[14:].max() < 10


@pytest.mark.long
def test_a_forearm_behind_a_stripe_is_not_drawn_to_the_arm_before_it(tmp_path):
    """T-EXP5. How far an elbow is off in the worst of twelve frames is chance: 3 to 15 degrees over five seeds."""
    worst = []
    for seed in range(3):
        changed = ("--frames", "0:12", "--set", f"stages.corrupt.seed={seed}")
        errors, _, _ = tracked(tmp_path / str(seed), "disturbed.yaml", *changed, names=ELBOWS)
        worst.append(errors.max())
    assert np.median(worst) < 8 and max(worst) < 20  # it left by 100


@pytest.mark.long
@pytest.mark.parametrize("clip", [CLIP, CLIP.with_name("shorts_steps")], ids=lambda clip: clip.name)
def test_elbows_that_two_of_four_cameras_do_not_see_are_within_three_degrees(tmp_path, clip):
    """T-EXP2: arms that swing, without a cloth model; below the shoulders two pictures are covered."""
    joints, views = np.load(clip / "truth" / "joints.npz"), open_recording(clip).cameras[1:3]
    elbows = joints["positions"][:30, np.isin(joints["names"], ELBOWS)].reshape(-1, 3)
    assert min(project(elbows, view)[:, 1].min() / view.size[1] for view in views) > 0.3 + 0.01
    event = f"{{what: covered, share: 0.7, views: [{', '.join(view.name for view in views)}]}}"
    covered = f"stages.corrupt before background={{use: corrupt, events: [{event}]}}"
    errors, _, _ = tracked(tmp_path / "run", "bare.yaml", "--frames", "0:30", "--set", covered, names=ELBOWS, clip=clip)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    print("elbows, RMS in degrees:", rms.round(2))
    assert (rms <= 3).all()


@pytest.mark.long
@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 1, 0)], ids=["on the spot", "cartwheel"])
def test_unseen_legs_of_a_person_who_turns_once_around_stay_plausible(axis):
    """T-EXP6 for a root that turns through 360 degrees: nothing wraps, and what nobody sees is as people are.

    The legs vanish in mid-swing and come back in another pose, where they are found. Without `parzen` they swing on: on
    the spot log p falls to -6.8 where -4.8 is allowed, and who turns over is dragged 15 degrees round.
    """
    scene = turning_person.scene()
    truth = [turning_person.pose(scene.body, index, axis) for index in range(turning_person.FRAMES)]
    frames = (turning_person.frame(scene, index, axis) for index in range(len(truth)))
    poses = list(followed(scene, truth[0], frames))
    off = [twists.log(true.root @ np.linalg.inv(pose.root))[:3] for true, pose in zip(truth, poses, strict=True)]
    assert np.degrees(np.linalg.norm(off, axis=1).max()) < 10
    density, angles = read(SHIPPED), np.array([pose.angles for pose in poses])
    screws = [scene.body.screw_names.index(name) for name in density.names]
    legs = [scene.body.screw_names.index(f"{joint}_{side}.flexion") for joint in ("hip", "knee") for side in "lr"]
    least = np.quantile([log_density(density, seen)[0] for seen in density.poses], 0.01)
    assert min(log_density(density, pose.angles[screws])[0] for pose in truth) > least
    assert min(log_density(density, angles[index][screws])[0] for index in turning_person.UNSEEN) > least
    wrong = np.degrees(np.abs(angles - [pose.angles for pose in truth]))
    print("legs, degrees off, from when they are seen again:", wrong[turning_person.UNSEEN.stop :][:, legs].max(axis=1))
    assert wrong[turning_person.UNSEEN.stop - 1, legs].max() > 10
    assert wrong[turning_person.UNSEEN.stop + BACK :, legs].max() < 5
    jumps = np.degrees(np.abs(np.diff(angles, axis=0)).max(axis=1))
    print(
        f"angles change by at most {jumps.max():.0f}, by {jumps[turning_person.UNSEEN[-1]]:.0f} as legs are seen again"
    )
    assert jumps.max() < 30


def followed(scene, begin, frames):
    """The poses that the tracker of a body without clothes finds."""
    stages = load_pipeline(shipped("pipelines", "bare.yaml")).stages
    stage = next(named.stage for named in stages if isinstance(named.stage, CoupledLoop))
    model, past, start = ClothedModel(scene=scene), Past(), Start(pose=begin, parameters=np.empty(0))
    for frame in frames:
        found = stage.fit(frame, past, start, model, lambda *_: None, Stopwatch(TIMED)).state.estimate
        past = past.after(Moment(time=frame.time, pose=found.pose, cloth=NO_CLOTH, observed=found.observed), {})
        yield found.pose


SPOIL = """
from dataclasses import replace

from mocapflow.components import Stage
from mocapflow.hookspecs import hookimpl
from mocapflow.results import Track
from mocapflow.scene import Scene


class Spoil(Stage):
    name = "spoil"

    def run(self, track: Track, scene: Scene) -> Track:
        angles = track.angles.copy()
        for joint in ("elbow_l", "knee_r"):
            angles[4, next(k for k, name in enumerate(scene.body.screw_names) if name.startswith(joint))] += 0.5
        return replace(track, angles=angles)


@hookimpl
def mocapflow_stages():
    return [Spoil]
"""


@pytest.mark.long
def test_a_frame_in_which_limbs_lie_beside_their_place_is_fitted_again(tmp_path):
    (tmp_path / "spoil.py").write_text(SPOIL)
    pipeline = tmp_path / "spoiled.yaml"
    base = shipped("pipelines", "skirt.yaml")
    pipeline.write_text(f"extends: {base}\nchange:\n  plugins: [spoil.py]\n  stages.spoil before second_look: spoil\n")
    errors, _, told = tracked(tmp_path / "run", pipeline, "--frames", "0:8", names=[*LEGS, *ELBOWS])
    notes = {frame["frame"]: frame.get("notes", []) for frame in told["per_frame"]}
    assert "fitted again from between its neighbours" in notes[4]
    assert errors[4].max() < errors[[2, 6]].max() + 2
