"""The same person and motion, filmed otherwise: what a tracker makes of both must be the same.

`python benchmarks/filmed_otherwise.py RECORDING OUT KIND…` writes a recording OUT/KIND for each of KINDS. It takes
recordings whose lenses do not bend, with one plate a camera, as the demo clips are; pictures are written without loss.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from mocapflow.assets import Camera
from mocapflow.geometry.cameras import undistort
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.pose2sim import write_cameras
from mocapflow.recordings.recording import open_recording
from mocapflow.records import F64, U8

PLATE = -1  # the frame number of a plate
WARM = np.array([0.5, 0.85, 1.1])  # factors of blue, green and red
LENSES = ((-0.25, 0.08, 0.001, -0.0005), (-0.2, 0.05, 0, 0.001), (0.12, -0.05, 0, 0), (-0.3, 0.1, 0, 0))
SIZES = ((1.5, 1.5), (0.75, 0.75), (1.25, 1.0), (1.0, 1.0))  # factors of width and height
OUT = 15  # the frame from which on a lamp is out
BELOW, FROM, TO = 0.78, 0.4, 0.77  # rows and columns of pictures where furniture stands, share of them
WOOD = np.array([70, 105, 130], np.uint8)  # BGR
TURN, SHIFT = cv2.Rodrigues(np.array([0, 0, 2.3]))[0], np.array([40.0, -25.0, 0.0])  # of the world, rad and m


class Kind(NamedTuple):
    """What is otherwise: the cameras, and what they show."""

    camera: Callable[[int, Camera], Camera]
    picture: Callable[[U8, int, int, Camera], U8]  # of the picture as it was, frame, number of the camera as it is


def brightened(factor: Callable[[int, int], float | F64]) -> Kind:
    """Grey levels multiplied, by frame and camera."""
    return Kind(lambda _, camera: camera, lambda image, frame, number, _: times(image, factor(frame, number)))


def times(image: U8, factor: float | F64) -> U8:
    """An image (H, W, 3) whose grey levels are multiplied."""
    return np.clip(image * factor + 0.5, 0, 255).astype(np.uint8)


def grey(image: U8, *_: object) -> U8:
    """An image (H, W, 3) without colours."""
    return np.repeat(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)[..., None], 3, axis=2)


def lamp_out(image: U8, frame: int, _number: int, _camera: Camera) -> U8:
    """An image (H, W, 3) in which a lamp has gone out at the left, from frame 15 on."""
    return image if frame < OUT else times(image, np.linspace(0.55, 1, image.shape[1])[:, None])


def before(image: U8) -> U8:
    """Return the part (h, w, 3) of an image (H, W, 3) where furniture stands between camera and person."""
    height, width = image.shape[:2]
    return image[round(BELOW * height) :, round(FROM * width) : round(TO * width)]


def behind_furniture(image: U8, _frame: int, number: int, _camera: Camera) -> U8:
    """An image (H, W, 3) with a box before the feet, if it is one of the first camera."""
    shown = image.copy()
    if number == 0:
        before(shown)[:] = WOOD
    return shown


def through_lens(image: U8, _frame: int, _number: int, camera: Camera) -> U8:
    """An image (H, W, 3) as a lens bends it."""
    height, width = image.shape[:2]
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(float)
    straight = undistort(pixels, camera).reshape(height, width, 2).astype(np.float32)
    return cv2.remap(image, straight, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def resized(number: int, camera: Camera) -> Camera:
    """A camera of another size; pixels of one are no squares."""
    size = np.rint(camera.size * SIZES[number]).astype(np.int32)
    intrinsics, factor = camera.intrinsics.copy(), size / camera.size
    intrinsics[:2, 2] = (intrinsics[:2, 2] + 0.5) * factor - 0.5
    intrinsics[0, 0], intrinsics[1, 1] = np.diag(intrinsics)[:2] * factor
    return replace(camera, size=size, intrinsics=intrinsics)


def moved(_: int, camera: Camera) -> Camera:
    """A camera in a world that is turned and shifted."""
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = TURN.T, -TURN.T @ SHIFT
    return replace(camera, camera_from_world=camera.camera_from_world @ back)


KINDS = {
    "grey": Kind(lambda _, camera: camera, grey),
    "dark": brightened(lambda *_: 0.45),
    "warm": brightened(lambda *_: WARM),
    "drift": brightened(lambda frame, number: 1 - 0.3 * max(frame, 0) / 60 * (1 + 0.3 * number) / 1.5),
    "flicker": brightened(lambda frame, number: 1 + 0.06 * np.sin(2.1 * frame + number) * (frame != PLATE)),
    "lamp": Kind(lambda _, camera: camera, lamp_out),
    "lens": Kind(lambda number, camera: replace(camera, distortion=np.array([*LENSES[number], 0])), through_lens),
    "sizes": Kind(
        resized, lambda image, _f, _n, camera: cv2.resize(image, camera.size.tolist(), None, 0, 0, cv2.INTER_AREA)
    ),
    "furniture": Kind(lambda _, camera: camera, behind_furniture),
    "world": Kind(moved, lambda image, *_: image),
}


def write(source: Path, folder: Path, name: str) -> None:
    """Write a recording as a kind of cameras has it."""
    kind, recording = KINDS[name], open_recording(source)
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("videos", "background"))
    cameras = [kind.camera(number, camera) for number, camera in enumerate(read_cameras(source))]
    write_cameras(folder / "cameras.toml", cameras)
    for number, camera in enumerate(cameras):
        (folder / "videos" / camera.name).mkdir(parents=True)
        (folder / "background").mkdir(exist_ok=True)
        plate = cv2.imread(str(source / "background" / f"{camera.name}.png"))
        shown = kind.picture(plate, PLATE, number, camera)
        cv2.imwrite(str(folder / "background" / f"{camera.name}.png"), shown)
        for frame in recording.seen_by(number).frames():
            shown = kind.picture(frame.images[0], frame.index, number, camera)
            cv2.imwrite(str(folder / "videos" / camera.name / f"{frame.index:05}.png"), shown)
    if name == "world":
        _move(folder)
    if name == "furniture":
        painted = np.zeros((*cameras[0].size[::-1], 3), np.uint8)
        before(painted)[:] = 255
        (folder / "occluders").mkdir()
        cv2.imwrite(str(folder / "occluders" / f"{cameras[0].name}.png"), painted)


def _move(folder: Path) -> None:
    """Turn and shift the first pose and the true joints with the world."""
    pose = json.loads((folder / "init.json").read_text())
    turned = TURN @ cv2.Rodrigues(np.array(pose["root_rotation"]))[0]
    pose["root_rotation"] = cv2.Rodrigues(turned)[0].ravel().tolist()
    pose["root_translation"] = (TURN @ pose["root_translation"] + SHIFT).tolist()
    (folder / "init.json").write_text(json.dumps(pose))
    joints = dict(np.load(folder / "truth" / "joints.npz"))
    np.savez(folder / "truth" / "joints.npz", **joints | {"positions": joints["positions"] @ TURN.T + SHIFT})


if __name__ == "__main__":
    for chosen in sys.argv[3:]:
        write(Path(sys.argv[1]), Path(sys.argv[2]) / chosen, chosen)
