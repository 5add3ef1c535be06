"""The first pose from silhouettes alone."""

import re
from pathlib import Path

import numpy as np
import pytest
from mocapflow_bodies.template import Template
from mocapflow_fitting.start_from_file import read_pose
from mocapflow_recovery import start_from_silhouettes
from mocapflow_recovery.placing import centred, heading_between, mask_centre, placed
from mocapflow_recovery.start_from_silhouettes import StartFromSilhouettes

from mocapflow.config.pipeline import load_pipeline
from mocapflow.data import NO_CLOTH, Pose
from mocapflow.errors import RecordingError
from mocapflow.geometry.angles import measure
from mocapflow.geometry.silhouettes import covered
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene

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


def test_without_plates_it_says_what_else_there_is(tmp_path):
    (tmp_path / "videos").symlink_to(SKIRT / "videos")
    (tmp_path / "cameras.toml").symlink_to(SKIRT / "cameras.toml")
    with pytest.raises(RecordingError, match="without clean plates(.|\n)*start_from_keypoints"):
        StartFromSilhouettes().need(open_recording(tmp_path))


@pytest.mark.parametrize("start", [0, 1], ids=["empty", "missing"])
def test_an_empty_room_is_an_error(tmp_path, start):
    """The clean plates themselves as pictures; of frame 1 there are none."""
    for plate in (SKIRT / "background").glob("*.png"):
        folder = tmp_path / "videos" / plate.stem
        folder.mkdir(parents=True)
        for number in (0, 2):
            (folder / f"{number:06}.png").symlink_to(plate)
    (tmp_path / "background").symlink_to(SKIRT / "background")
    (tmp_path / "cameras.toml").symlink_to(SKIRT / "cameras.toml")
    recording = open_recording(tmp_path, start=start)
    scene = Scene(cameras=recording.cameras, body=Template(shape=0.0).load(SKIRT))
    with pytest.raises(RecordingError, match="0 cameras show a person"):
        StartFromSilhouettes().run(recording, scene)


def test_a_pose_that_fits_badly_is_warned_of(monkeypatch, caplog):
    """One that nobody has searched from."""
    for name, value in {
        "DIRECTIONS": 4,
        "CANDIDATES": 1,
        "SEARCHES": 1,
        "search": lambda cost, begin, *_: begin,
    }.items():
        monkeypatch.setattr(start_from_silhouettes, name, value)
    recording = open_recording(SKIRT)
    scene = Scene(cameras=recording.cameras, body=Template(shape=0.0).load(SKIRT))
    StartFromSilhouettes(draper=None).run(recording, scene)
    assert re.search(r"first pose: \d+\.\d mm off the silhouettes .* may be wrong; .* start_from_file", caplog.text)


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
