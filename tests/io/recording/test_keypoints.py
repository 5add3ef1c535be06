"""OpenPose files, and what is said of bad ones."""

import json
from dataclasses import replace

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.recording.keypoints import keypoint_files, odd_keypoints, people_at, read_keypoints
from tests.fixtures.recordings import look_at

CAMERA = look_at("cam02", np.array([4.0, 0.0, 1.5]))


def write(path, *people):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [{"person_id": [-1], "pose_keypoints_2d": list(map(float, np.ravel(person)))} for person in people]
    path.write_text(json.dumps({"version": 1.3, "people": rows}))
    return path


def person(points=25, seed=0):
    return np.random.default_rng(seed).uniform(0, 1, size=(points, 3)) * [64, 48, 1]


def test_people_of_a_frame(tmp_path):
    path = write(tmp_path / "cam01.0003.json", person(), person(seed=1))
    assert keypoint_files(tmp_path) == {3: path}
    np.testing.assert_allclose(read_keypoints(path), [person(), person(seed=1)])
    assert read_keypoints(write(tmp_path / "nobody.0.json")).shape == (0, 0, 3)


@pytest.mark.parametrize(
    ("name", "frame"),
    [("cam01.0007.json", 7), ("Static_cam_01.00011.json", 11), ("video_000000000012_keypoints.json", 12)],
)
def test_the_last_number_of_the_name_is_the_frame(tmp_path, name, frame):
    write(tmp_path / name, person())
    assert list(keypoint_files(tmp_path)) == [frame]


def test_nan_is_not_seen(tmp_path):
    points = person()
    points[4, 0], points[6, 2] = np.nan, np.inf
    write(tmp_path / "a.0.json", points)
    (found,) = people_at(keypoint_files(tmp_path), 0)
    assert np.isfinite(found).all()
    assert (found[[4, 6]] == 0).all()
    np.testing.assert_allclose(np.delete(found, [4, 6], 0), np.delete(points, [4, 6], 0))


def test_missing_and_broken_files_show_nobody(tmp_path):
    (tmp_path / "a.0.json").write_text('{"people": [')
    files = keypoint_files(tmp_path)
    assert people_at(files, 0).shape == people_at(files, 1).shape == people_at(None, 0).shape == (0, 0, 3)


HUGE = f'{{"people": [{{"pose_keypoints_2d": [1{"0" * 400}, 2, 1]}}]}}'  # beyond any float


@pytest.mark.parametrize("text", ["[]", '{"people": 3}', '{"people": [{"pose_keypoints_2d": [1, 2]}]}', "{}", HUGE])
def test_not_openpose(tmp_path, text):
    (tmp_path / "a.0.json").write_text(text)
    with pytest.raises(
        RecordingError, match=r"a\.0\.json  not a file of keypoints: .*\n       expected OpenPose's format"
    ):
        read_keypoints(tmp_path / "a.0.json")


def test_everything_odd_is_said(tmp_path):
    holes = person()
    holes[0, 0] = np.nan
    write(tmp_path / "c.0.json", holes)
    write(tmp_path / "c.1.json", person(17))
    (tmp_path / "c.2.json").write_text("")
    for frame in (4, 5, 6):
        write(tmp_path / f"c.{frame}.json", person())
    assert odd_keypoints(CAMERA, tmp_path, 6) == [
        "cam02: keypoints of frame 2 can't be read (not JSON: Expecting value): nobody is seen there",
        "cam02: keypoints of frame 0 are not all numbers (NaN): these points count as not seen",
        "cam02: keypoints of frame 6 lie after the last frame, 5: they are left out",
        "cam02: keypoints of frame 3 are missing: nobody is seen there",
        "cam02: people with 17 and with 25 keypoints in one folder",
    ]
    for path in tmp_path.iterdir():
        path.unlink()
    for frame in range(3):
        write(tmp_path / f"c.{frame}.json", person())
    assert odd_keypoints(CAMERA, tmp_path, 3) == []
    (tmp_path / "c.0.json").unlink()
    assert odd_keypoints(CAMERA, tmp_path, 3) == ["cam02: keypoints of frame 0 are missing: nobody is seen there"]


@pytest.mark.parametrize("points", [person() * [1, 1, 0] + [0, 0, 87], person(24)[:, :2] + 3])  # pairs fill 16 rows
def test_confidences_that_are_none(tmp_path, points):
    write(tmp_path / "c.0.json", person() * [1, 1, 0] + [0, 0, 1.1])
    assert odd_keypoints(CAMERA, tmp_path, 1) == []
    write(tmp_path / "c.0.json", points)
    assert odd_keypoints(CAMERA, tmp_path, 1) == [
        "cam02: keypoints of frame 0 have confidences far beyond 1: are they percents, or is there none behind x and y?"
    ]


def test_points_without_a_confidence(tmp_path):
    write(tmp_path / "c.0.json", person(17)[:, :2])
    assert odd_keypoints(CAMERA, tmp_path, 1) == [
        "cam02: keypoints of frame 0 can't be read (34 numbers, which are not three a point): nobody is seen there"
    ]


def test_nobody_is_no_share_of_a_picture(tmp_path):
    write(tmp_path / "c.0.json", np.zeros((25, 3)))
    write(tmp_path / "c.1.json")
    assert odd_keypoints(CAMERA, tmp_path, 2) == []


def test_shares_of_the_picture_are_no_pixels(tmp_path):
    write(tmp_path / "c.0.json", person() / [64, 48, 0.8])  # OpenPose's confidence may be a little beyond 1
    assert odd_keypoints(CAMERA, tmp_path, 1) == [
        "cam02: all keypoints lie within one pixel: are they shares of the picture? expected pixels"
    ]


@pytest.mark.parametrize(("times", "told"), [(1.0, False), (2.2, True)])
def test_keypoints_of_pictures_of_another_size(tmp_path, times, told):
    points = np.stack([np.linspace(2, 62, 20), np.linspace(2, 46, 20), np.full(20, 0.9)], axis=1)
    write(tmp_path / "c.0.json", np.concatenate([points * [times, times, 1], np.zeros((5, 3))]))
    said = "cam02: most keypoints lie outside its pictures of 64 x 48 px: are they of pictures of another size?"
    assert odd_keypoints(CAMERA, tmp_path, 1) == ([said] if told else [])
    assert odd_keypoints(replace(CAMERA, size=np.zeros(2, np.int32)), tmp_path, 1) == []
