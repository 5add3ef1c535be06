"""Finds 2D keypoints with mediapipe and writes them as OpenPose does, in the order of HALPE_26.

python examples/mediapipe_keypoints.py RECORDING [OUT]: for every camera in RECORDING/videos, a video or a folder of
images; OUT is RECORDING/keypoints unless given. It needs an environment of its own (`pip install mediapipe==0.10.14`,
up to Python 3.12), because mediapipe wants another OpenCV than mocapflow does. One person is found in each view.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

Point = tuple[float, float, float]  # px, px, confidence
UNSEEN: Point = (0.0, 0.0, 0.0)
# Of mediapipe's 33 landmarks those that HALPE_26 has, in its order: nose, eyes, ears, shoulders, elbows, wrists, hips,
# knees, ankles, left before right. Its "foot index" stands for the big toe.
FACE_AND_LIMBS = (0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28)
SHOULDERS, HIPS, BIG_TOES, HEELS = (11, 12), (23, 24), (31, 32), (29, 30)
OF_A_VIDEO = {"smooth_landmarks": False, "model_complexity": 1}  # smoothed landmarks lag; mediapipe ships this model


class Landmark(Protocol):
    """A landmark of mediapipe: shares of the picture's width and height, and how likely it is seen."""

    x: float
    y: float
    visibility: float


def halpe_26(landmarks: Sequence[Landmark], width: int, height: int) -> list[Point]:
    """Return the 26 keypoints of a person; what mediapipe does not know (crown, small toes) has confidence 0.

    mediapipe measures from the corner of the first pixel, OpenPose and mocapflow from its centre.
    """
    found: list[Point] = [(p.x * width - 0.5, p.y * height - 0.5, p.visibility) for p in landmarks]
    neck, mid_hip = (_between(*(found[k] for k in pair)) for pair in (SHOULDERS, HIPS))
    feet = [found[k] for k in BIG_TOES] + [UNSEEN, UNSEEN] + [found[k] for k in HEELS]
    return [*(found[k] for k in FACE_AND_LIMBS), UNSEEN, neck, mid_hip, *feet]


def _between(one: Point, other: Point) -> Point:
    return (one[0] + other[0]) / 2, (one[1] + other[1]) / 2, min(one[2], other[2])


def pictures(source: Path) -> Iterator[tuple[str, npt.NDArray[np.uint8]]]:
    """Yield the number and the RGB picture (H, W, 3) of every frame, of a video or of a folder of images."""
    if source.is_dir():
        for path in sorted(source.iterdir()):
            if (picture := cv2.imread(str(path))) is not None:
                yield path.stem, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.uint8)
        return
    video = cv2.VideoCapture(str(source))
    frame = 0
    while (read := video.read())[0]:
        yield f"{frame:012d}", cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB).astype(np.uint8)
        frame += 1


def write_view(source: Path, out: Path) -> int:
    """Write the keypoints of one camera, a file a frame as OpenPose names them; return the number of frames."""
    from mediapipe.python.solutions.pose import Pose

    out.mkdir(parents=True, exist_ok=True)
    frames = 0
    with Pose(**OF_A_VIDEO) as pose:
        for number, picture in pictures(source):
            found = pose.process(picture).pose_landmarks
            height, width = picture.shape[:2]
            points = [] if found is None else [halpe_26(found.landmark, width, height)]
            people = [{"pose_keypoints_2d": [round(v, 3) for point in each for v in point]} for each in points]
            (out / f"{number}_keypoints.json").write_text(json.dumps({"version": 1.3, "people": people}))
            frames += 1
    return frames


def main() -> None:
    """Write the keypoints of all cameras, and tell what they cost."""
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    recording = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else recording / "keypoints"
    for source in sorted((recording / "videos").iterdir()):
        begin = time.process_time()
        frames = write_view(source, out / f"{source.stem}_json")
        if not frames:
            raise SystemExit(f"{source}: no picture in it can be read")
        spent = 1000 * (time.process_time() - begin) / frames
        print(f"{source.stem}: {frames} frames, {spent:.0f} ms of CPU each")


if __name__ == "__main__":
    main()
