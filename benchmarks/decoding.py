"""Cost of decoding and undistorting a frame, of opening a recording, and memory over 60 and 600 frames.

    OMP_NUM_THREADS=1 python benchmarks/decoding.py [RECORDING ...]

It writes its own videos (MPEG-4, moving noise) and prints milliseconds of one core per frame and view, beside a
plain `cv2.VideoCapture.read` of the same files in the same run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from mocapflow.assets import Camera
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.recordings.recording import open_recording

SIZES = {"640 x 800": (640, 800), "1088 x 1920": (1088, 1920)}
LENS = np.array([-0.046, 0.14, 0.0006, 0.0007, 0.0])


def write(folder: Path, size: tuple[int, int], frames: int, distortion: np.ndarray) -> None:
    """Write a recording of one camera."""
    width, height = size
    place = np.eye(4)
    place[2, 3] = 3.0
    k = np.array([[1.5 * width, 0, (width - 1) / 2], [0, 1.5 * width, (height - 1) / 2], [0, 0, 1.0]])
    camera = Camera(
        name="cam01", size=np.array(size, np.int32), intrinsics=k, distortion=distortion, camera_from_world=place
    )
    (folder / "videos").mkdir(parents=True)
    write_cameras(folder / "cameras.toml", [camera])
    writer = cv2.VideoWriter(str(folder / "videos" / "cam01.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 60, size)
    noise = np.random.default_rng(0).integers(0, 40, (height, width, 3), np.uint8)
    for index in range(frames):
        writer.write(np.roll(noise, 7 * index, axis=1) + np.uint8(100 * (index % 2)))
    writer.release()


def cpu_ms(count: int, action: Callable[..., object], *arguments: object) -> float:
    """Return milliseconds of CPU per frame."""
    began = time.process_time()
    action(*arguments)
    return 1000 * (time.process_time() - began) / count


def plain(folder: Path) -> None:
    """Read every video as OpenCV's tutorial does."""
    for path in sorted((folder / "videos").iterdir()):
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        while capture.read()[0]:
            pass


def walk(folder: Path, scale: float = 1.0) -> None:
    """Read every frame of a recording."""
    for _ in open_recording(folder, scale=scale).frames():
        pass


def compare(name: str, folder: Path) -> None:
    """Print the cost per frame and view of a recording."""
    recording = open_recording(folder)
    count = recording.length * len(recording.cameras)
    next(recording.frames())  # warm
    costs = (
        cpu_ms(count, plain, folder),
        cpu_ms(count, walk, folder),
        cpu_ms(count, walk, folder, 0.5),
        cpu_ms(len(recording.cameras), open_recording, folder),
    )
    print(f"{name:34}{costs[0]:10.2f}{costs[1]:10.2f}{costs[2]:12.2f}{costs[3]:8.1f}")


def speed(recordings: Sequence[Path], frames: int = 60) -> None:
    """Print the cost of both sizes, with and without a lens, and of the recordings given."""
    print(f"{'ms of one core per frame and view':34}{'cv2 read':>10}{'frames':>10}{'half size':>12}{'open':>8}")
    for name, size in SIZES.items():
        for lens, distortion in (("no lens", np.zeros(5)), ("lens", LENS)):
            with tempfile.TemporaryDirectory() as place:
                write(Path(place) / "a", size, frames, distortion)
                compare(f"{name}, {lens}", Path(place) / "a")
    for folder in recordings:
        compare(folder.name, folder)


def memory() -> None:
    """Print the peak memory of a process that reads 60 and one that reads 600 frames of the larger size."""
    for frames in (60, 600):
        with tempfile.TemporaryDirectory() as place:
            write(Path(place) / "a", SIZES["1088 x 1920"], frames, LENS)
            command = [sys.executable, __file__, "--peak", str(Path(place) / "a")]
            peak = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
        print(f"peak memory, {frames} frames of 1088 x 1920: {peak} MB")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    if sys.argv[1:2] == ["--peak"]:
        walk(Path(sys.argv[2]))
        status = Path("/proc/self/status").read_text()  # getrusage would count what the parent held before exec
        print(round(int(status.split("VmHWM:")[1].split()[0]) / 1024))
    else:
        speed([Path(folder) for folder in sys.argv[1:]])
        memory()
