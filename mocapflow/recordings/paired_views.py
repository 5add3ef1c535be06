"""What any two cameras of a recording agree on: the angles of the planes through both in which they see the person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mocapflow.assets import Camera
from mocapflow.data import BORDER, Frame
from mocapflow.geometry.epipolar import pencil_axes, plane_angles
from mocapflow.recordings.recording import Recording
from mocapflow.records import F32, F64, U8, Bool

Signals = Callable[[int, int], tuple[F64, F64]]
"""What two cameras see at every moment: (T, K) rad of one, (T, K) of the other; NaN where unknown."""

CONFIDENT = 0.3  # of a keypoint
DIFFERENT = 25  # grey levels from the empty room
SAMPLES = 15  # pictures that the empty room is the median of, without clean plates
CALM = 5  # px, median filter of a silhouette


def keypoint_signals(recording: Recording) -> Signals:
    """Return the plane angles of the keypoints of the person seen best, at the frames of a recording."""
    pixels = np.stack([_keypoints(recording, camera) for camera in range(len(recording.views))], axis=1)

    def signals(one: int, other: int) -> tuple[F64, F64]:
        axes = pencil_axes(recording.cameras[one], recording.cameras[other])
        angles = [plane_angles(pixels[:, camera], recording.cameras[camera], axes) for camera in (one, other)]
        return angles[0], angles[1]

    return signals


def _keypoints(recording: Recording, camera: int) -> F64:
    """Return keypoints (T, K, 2) px of one camera, NaN where unknown; no picture is decoded."""
    seen = [recording.people(index)[camera] for index in recording.indices]
    best = [people[people[..., 2].sum(axis=1).argmax()] if len(people) else None for people in seen]
    count = max((len(person) for person in best if person is not None), default=0)
    found = np.full((len(seen), count, 2), np.nan)
    for row, person in enumerate(best):
        if person is not None and len(person) == count:
            found[row] = np.where(person[:, 2:] > CONFIDENT, person[:, :2], np.nan)
    return found


def outline_signals(recording: Recording) -> Signals:
    """Return the angles of the outermost planes that touch the person's silhouette, at the frames of a recording."""
    rooms = _rooms(recording)
    outlines = [_outlines(frame, rooms) for frame in recording.frames()]

    def signals(one: int, other: int) -> tuple[F64, F64]:
        cameras = recording.cameras
        axes = pencil_axes(cameras[one], cameras[other])
        touched = [_touching([row[c] for row in outlines], cameras[c], axes) for c in (one, other)]
        return touched[0], touched[1]

    return signals


def _touching(outlines: list[F64], camera: Camera, axes: F64) -> F64:
    """Return the angles (T, 2) of the outermost planes that touch outlines, NaN where the outline is cut or missing."""
    found = np.full((len(outlines), 2), np.nan)
    for row, pixels in enumerate(outlines):
        if not len(pixels):
            continue
        angles = plane_angles(pixels, camera, axes)
        ends = [int(angles.argmin()), int(angles.argmax())]
        inside = np.all((pixels >= BORDER) & (pixels < camera.size - BORDER), axis=1)
        if angles.max() - angles.min() < np.pi:  # else the other camera stands behind the person
            found[row] = np.where(inside[ends], angles[ends], np.nan)
    return found


def _outlines(frame: Frame, rooms: Sequence[F32]) -> list[F64]:
    """Return the outline (N, 2) px of the person in each view; empty where a view is lost."""
    views = zip(frame.images, rooms, frame.usable, strict=True)
    return [_outline(image, room) if usable else np.empty((0, 2)) for image, room, usable in views]


def _outline(image: U8, room: F32) -> F64:
    """Return the border pixels (N, 2) of the largest part of an image that differs from the empty room."""
    import cv2

    borders, _ = cv2.findContours(foreground(image, room).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not borders:
        return np.empty((0, 2))
    return np.asarray(max(borders, key=cv2.contourArea), np.float64).reshape(-1, 2)


def foreground(image: U8, room: F32) -> Bool:
    """Return where (H, W) an image differs from the empty room, without single pixels of noise."""
    import cv2

    different = np.abs(image.astype(np.float32) - room).max(axis=2) > DIFFERENT
    return np.asarray(cv2.medianBlur(different.view(np.uint8), CALM), bool)


def _rooms(recording: Recording) -> list[F32]:
    """Return the empty scene (H, W, 3) of each camera: clean plates, or a median."""
    plates = recording.background()
    if plates is not None:
        return list(plates.mean)
    step = max(len(recording.indices) // SAMPLES, 1)
    sampled = list(replace(recording, indices=recording.indices[::step]).frames())
    return [
        np.median([f.images[c] for f in sampled if f.usable[c]], axis=0).astype(np.float32)
        for c in range(len(recording.views))
    ]
