"""The first pose from silhouettes alone."""

import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from mocapflow_bodies.template import Template
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_recovery import silhouette_target, start_from_silhouettes
from mocapflow_recovery.placing import centred, heading_between, largest_changes, mask_centre, placed
from mocapflow_recovery.silhouette_target import NATURAL, Target
from mocapflow_recovery.start_from_silhouettes import StartFromSilhouettes
from mocapflow_recovery.trimaps import small_rooms

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import NO_CLOTH, Pose
from mocapflow.errors import RecordingError
from mocapflow.geometry.angles import measure
from mocapflow.geometry.silhouettes import covered
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene
from mocapflow.testing import pictures, scenes

DATA = Path(__file__).parents[2] / "examples" / "data"
SKIRT = DATA / "skirt_steps"


@pytest.fixture(scope="module")
def bare():
    return Scene(cameras=open_recording(SKIRT).cameras, body=Template(shape=0.0).load(SKIRT))


def test_a_body_is_put_where_it_is_wanted_and_turned(bare):
    angles = np.zeros(len(bare.body.twists))
    middle = np.array([0.2, -0.1, 1.0])
    for turn in (0.0, 2.0):
        pose = placed(bare, turn, angles, middle)
        vertices = bare.surface(pose, NO_CLOTH).vertices
        np.testing.assert_allclose((vertices.max(axis=0) + vertices.min(axis=0)) / 2, middle, atol=1e-9)
        assert heading_between(placed(bare, 0.0, angles, middle), pose) == pytest.approx(turn)
        np.testing.assert_allclose(pose.root[:2, 1], [-np.sin(turn), np.cos(turn)])  # counter-clockwise from above


def test_rays_through_the_middles_of_silhouettes_meet_in_the_middle_of_a_person(bare):
    pose = placed(bare, 0.5, np.zeros(len(bare.body.twists)), np.array([0.1, 0.1, 0.9]))
    surface = bare.surface(pose, NO_CLOTH)
    found = mask_centre([covered(surface, camera) for camera in bare.cameras], bare.cameras)
    assert np.abs(found - [0.1, 0.1, 0.9]).max() < 0.15  # arms and feet are not in the middle of the box
    shifted = Pose(root=np.block([[np.eye(3), np.array([[0.3], [-0.2], [0.1]])], [np.zeros(3), 1.0]]) @ pose.root,
                   angles=pose.angles)  # fmt: skip
    there = mask_centre([covered(bare.surface(shifted, NO_CLOTH), camera) for camera in bare.cameras], bare.cameras)
    np.testing.assert_allclose(there - found, [0.3, -0.2, 0.1], atol=0.02)


def test_a_pose_out_of_sight_stays_where_it_is(bare):
    away = placed(bare, 0.0, np.zeros(len(bare.body.twists)), np.array([0.0, 0.0, 90.0]))
    np.testing.assert_array_equal(centred(away, bare, np.zeros(3), bare.cameras).root, away.root)
    here = placed(bare, 0.0, away.angles, np.array([0.2, 0.0, 1.0]))
    goal = np.array([0.0, 0.1, 0.9])
    moved = bare.surface(centred(here, bare, goal, bare.cameras), NO_CLOTH)
    np.testing.assert_allclose(
        mask_centre([covered(moved, camera) for camera in bare.cameras], bare.cameras), goal, atol=0.02
    )


def test_the_largest_change_of_each_usable_view_is_the_person():
    """In the second view there is nobody, but a speck; in the third something small is left besides."""
    scene = scenes.tiny_scene()
    frame = pictures.tiny_frame(scene, scenes.tiny_pose(scene))
    empty, crowded = scene.background.mean[1].astype(np.uint8), frame.images[2].copy()
    empty[100:102, 100:102] = crowded[4:24, 4:24] = 240
    frame = replace(
        frame, images=(frame.images[0], empty, crowded, frame.images[3]), usable=np.array([True, True, True, False])
    )
    masks, cameras = largest_changes(frame, small_rooms(scene.background, scene.cameras))
    assert [camera.name for camera in cameras] == ["cam01", "cam02", "cam03"]
    assert masks[0].sum() > 500 and not masks[1].any()
    assert masks[2].sum() > 500 and not masks[2][:12, :12].any()


def test_what_hides_the_scene_is_not_the_person():
    scene = scenes.tiny_scene()
    frame, bar = pictures.tiny_frame(scene, scenes.tiny_pose(scene)), np.zeros((240, 320), bool)
    bar[:, :80] = True  # beside the person, larger than they are
    images = tuple(np.where(bar[..., None], np.uint8(0), image) for image in frame.images)
    hidden = replace(frame, images=images, hidden=(bar,) * len(images))
    rooms = small_rooms(scene.background, scene.cameras)
    for mask, without in zip(largest_changes(hidden, rooms)[0], largest_changes(frame, rooms)[0], strict=True):
        assert not mask[:, :40].any() and mask.sum() > 0.9 * without.sum()


def test_without_plates_it_says_what_else_there_is(tmp_path):
    (tmp_path / "videos").symlink_to(SKIRT / "videos")
    (tmp_path / "cameras.toml").symlink_to(SKIRT / "cameras.toml")
    with pytest.raises(RecordingError, match="without clean plates(.|\n)*start_from_keypoints"):
        StartFromSilhouettes().need(open_recording(tmp_path))


@pytest.mark.parametrize("start", [0, 1, 2], ids=["empty", "missing", "a person in one view"])
def test_an_empty_room_is_an_error(tmp_path, start):
    """The clean plates themselves as pictures; of frame 1 there are none, and one of frame 2 shows the person."""
    for plate in (SKIRT / "background").glob("*.png"):
        folder = tmp_path / "videos" / plate.stem
        folder.mkdir(parents=True)
        for number in (0, 2):
            shutil.copy(plate, folder / f"{number:06}.png")
    cv2.imwrite(str(tmp_path / "videos/cam01/000002.png"), open_recording(SKIRT).frame(0).images[0])
    (tmp_path / "background").symlink_to(SKIRT / "background")
    (tmp_path / "cameras.toml").symlink_to(SKIRT / "cameras.toml")
    recording = open_recording(tmp_path, start=start)
    scene = Scene(cameras=recording.cameras, body=Template(shape=0.0).load(SKIRT))
    with pytest.raises(RecordingError, match=f"frame {start}: fewer than two cameras show a person"):
        StartFromSilhouettes().run(recording, scene)


def test_a_pose_counts_as_farther_the_farther_it_is_from_all_that_were_seen():
    scorer = SimpleNamespace(distances=lambda poses: np.full(len(poses), 0.01))
    target = Target(scorer, None, np.array([[0.5, np.nan], [0.0, 2.0]]))
    off = [0, 0], [0.5, 0], [0, 2], [0.5 + NATURAL, -NATURAL]
    costs = target.costs([Pose(root=np.eye(4), angles=np.array(angles, float)) for angles in off])
    assert costs == pytest.approx([0.01, 0.01, 0.01, 0.02])  # standing upright is known without a file


def test_a_pose_that_fits_badly_is_warned_of(monkeypatch, caplog):
    """One that nobody has searched from."""
    for name, value in {
        "DIRECTIONS": 4,
        "CANDIDATES": 1,
        "SEARCHES": 2,
        "search": lambda cost, begin, *_: begin,
    }.items():
        monkeypatch.setattr(silhouette_target, name, value)
    monkeypatch.setattr(start_from_silhouettes, "likely_headings", lambda poses, off: list(range(len(poses))))
    recording = open_recording(SKIRT)
    scene = Scene(cameras=recording.cameras, body=Template(shape=0.0).load(SKIRT))
    start = StartFromSilhouettes(draper=None).run(recording, scene)
    assert len(start.others) == 1 and heading_between(start.pose, start.others[0]) > 1
    assert re.search(r"first pose: \d+\.\d mm off the silhouettes .* may be wrong; .* start_from_file", caplog.text)


def test_a_search_is_repeated_as_long_as_that_helps(monkeypatch):
    """Poses are what they cost here."""
    ends, seeds = iter([8.0, 5.0, 4.9, 1.0]), []
    monkeypatch.setattr(Target, "costs", lambda target, poses: np.array(poses))
    monkeypatch.setattr(Target, "searched", lambda target, pose, seed: seeds.append(seed) or next(ends))
    assert Target(None, None, None).searched_again(10.0, 7) == 4.9
    assert seeds == [7, 8, 9]


@pytest.mark.long
@pytest.mark.parametrize("clip", ["skirt_steps", "shorts_steps"])
@pytest.mark.parametrize("frame", [0, 30])
def test_a_person_is_found_without_any_hint(clip, frame, caplog):
    """As near as a track needs: it looks the right way, and no joint is far off (a knee 28° at most)."""
    pipeline = load_pipeline(shipped("pipelines", "skirt.yaml"), recording=DATA / clip)
    recording, body = open_recording(DATA / clip, start=frame), pipeline.body.load(DATA / clip)
    scene = Scene(cameras=recording.cameras, body=body, garment=pipeline.garment.sew(body))
    start = StartFromSilhouettes().run(recording, scene)
    given = read_pose(DATA / clip / "init.json", body)
    assert np.degrees(heading_between(start.pose, given)) < 30  # they hardly turn
    found = measure(body, start.pose.root[None], start.pose.angles[None])
    lines = (DATA / clip / "truth" / "angles.csv").read_text().splitlines()
    truth = dict(zip(lines[0].split(","), map(float, lines[1 + frame].split(",")), strict=True))
    off = [value - truth[name] for name, value in zip(found.names, found.value[0], strict=True) if name in truth]
    assert np.sqrt(np.mean(np.square(off))) < 15
    assert "may be wrong" not in caplog.text
