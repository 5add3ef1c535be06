"""The example that writes mediapipe's landmarks as OpenPose keypoints; mediapipe itself is not installed here."""

from __future__ import annotations

import importlib.util
import sys
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest
from mocapflow_fitting.keypoint_layouts import LAYOUTS

from mocapflow.io.recording.keypoints import keypoint_files, people_at

ROOT = Path(__file__).parents[1]
SKIRT = ROOT / "examples" / "data" / "skirt_steps" / "videos" / "cam01.mp4"
SIZE = (80, 60)  # px
# The names of mediapipe's documentation, in its order, as ours are built.
FACE = ["nose", "_", "eye_l", "_", "_", "eye_r", "_", "ear_l", "ear_r", "_", "_"]
LIMBS = ("shoulder", "elbow", "wrist", "pinky", "index", "thumb", "hip", "knee", "ankle", "heel", "big_toe")
NAMES = FACE + [f"{name}_{side}" for name in LIMBS for side in "lr"]
MIDWAY = {"neck": ("shoulder_l", "shoulder_r"), "hip_mid": ("hip_l", "hip_r")}


@pytest.fixture
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mediapipe_keypoints", ROOT / "examples" / "mediapipe_keypoints.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def landmarks() -> list[SimpleNamespace]:
    """One landmark a column and a row, each less likely than the one before."""
    return [SimpleNamespace(x=k / 40, y=k / 50, visibility=1 - k / 100) for k in range(len(NAMES))]


def where(name: str) -> np.ndarray:
    k = NAMES.index(name)
    return np.array([k / 40 * SIZE[0] - 0.5, k / 50 * SIZE[1] - 0.5, 1 - k / 100])


def test_every_keypoint_is_the_landmark_of_its_name(example: ModuleType) -> None:
    points = dict(zip(LAYOUTS["halpe_26"], example.halpe_26(landmarks(), *SIZE), strict=True))
    for name, point in points.items():
        if name in MIDWAY:
            left, right = (where(end) for end in MIDWAY[name])
            np.testing.assert_allclose(point, [*(left + right)[:2] / 2, min(left[2], right[2])])
        elif name in NAMES:
            np.testing.assert_allclose(point, where(name))
        else:
            assert name in ("head_top", "small_toe_l", "small_toe_r") and point[2] == 0


def test_mocapflow_reads_what_is_written(example: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a folder of images, by their numbers; somebody is seen in the first alone."""
    shown: list[np.ndarray] = []

    def process(picture: np.ndarray) -> SimpleNamespace:
        shown.append(picture)
        return SimpleNamespace(pose_landmarks=SimpleNamespace(landmark=landmarks()) if len(shown) == 1 else None)

    pose = ModuleType("mediapipe.python.solutions.pose")
    pose.Pose = lambda **_: nullcontext(SimpleNamespace(process=process))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, pose.__name__, pose)
    (tmp_path / "cam01").mkdir()
    for number in (7, 8):
        cv2.imwrite(
            str(tmp_path / "cam01" / f"{number:06d}.png"), np.full((SIZE[1], SIZE[0], 3), (255, 0, 0), np.uint8)
        )
    assert example.write_view(tmp_path / "cam01", tmp_path / "cam01_json") == 2
    files = keypoint_files(tmp_path / "cam01_json")
    assert sorted(files) == [7, 8]
    np.testing.assert_allclose(people_at(files, 7)[0], example.halpe_26(landmarks(), *SIZE), atol=1e-3)
    assert people_at(files, 8).shape[0] == 0
    assert tuple(shown[0][0, 0]) == (0, 0, 255), "mediapipe wants red first"


def test_a_video_gives_all_its_frames(example: ModuleType) -> None:
    numbers = [number for number, _ in example.pictures(SKIRT)]
    assert [int(number) for number in numbers] == list(range(60))
