"""Whether the first frame, its clean plates and the first pose belong together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mocapflow.data import NO_CLOTH
from mocapflow.dressing.guards import body_of
from mocapflow.errors import MocapflowError
from mocapflow.geometry.silhouettes import covered
from mocapflow.io.findings import Finding, warning
from mocapflow.io.subject import first_pose
from mocapflow.recordings.paired_views import foreground
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.records import Bool
from mocapflow.registry import Registry
from mocapflow.scene import Scene

FOREIGN = 0.5  # share of a picture that differs from its empty room: more, and it is no picture of that room
COVERED = 0.5  # share of the body that shows somebody, 0.6 to 0.9 where the pose is about right: less, and nobody is
EMPTY = 0.02  # pixels that differ from the empty room by those of the body: less is noise, 1.2 to 1.7 a person in cloth
SMALL, LARGE = 0.7, 1.3  # height of the body by that of who is seen; 0.85 to 0.98 where it is the person's, with shadow


def examine_first_frame(folder: Path, registry: Registry) -> Iterator[Finding]:
    """Yield what is odd about the first frame beside clean plates; what can't be read is told elsewhere."""
    try:
        recording = open_recording(folder)
        plates, frame = recording.background(), recording.frame(0)
    except MocapflowError:
        return
    if plates is None:
        return
    names = [view.lens.name for view in recording.views]
    views = zip(names, frame.images, plates.mean, frame.usable, strict=True)
    somebody = {name: foreground(image, room) for name, image, room, usable in views if usable}
    for name, shift in zip(names, plates.turned_px, strict=True):
        if shift:
            hint = "the plate is laid over the first frame; calibrate again, if that is older than the plate"
            yield warning(f"{name} has moved by {shift:.1f} px since its clean plate was taken", hint, folder)
    foreign = [name for name, seen in somebody.items() if seen.mean() > FOREIGN]
    if foreign:
        hint = "was the camera moved, the light changed, or the file of another camera copied here?"
        yield warning(f"the first frame of {', '.join(foreign)} is not of the room in its clean plate", hint, folder)
    elif (bodies := _bodies(recording, registry)) is not None:
        if frame.hidden:
            bodies = [body & ~hidden for body, hidden in zip(bodies, frame.hidden, strict=True)]
        yield from _beside(dict(zip(names, bodies, strict=True)), somebody, folder)


def _beside(bodies: Mapping[str, Bool], somebody: Mapping[str, Bool], folder: Path) -> Iterator[Finding]:
    """Yield what is odd about who is seen in views, by the names of their cameras, beside the body (H, W) there."""
    empty = [name for name, seen in somebody.items() if seen.sum() < EMPTY * bodies[name].sum()]
    if empty:
        hint = "was the plate taken with the person in it, or does the person come in later?"
        yield warning(f"the first frame of {', '.join(empty)} differs nowhere from its clean plate", hint, folder)
    somebody = {name: seen for name, seen in somebody.items() if name not in empty}
    views = [(bodies[name], _largest(seen)) for name, seen in somebody.items() if bodies[name].any()]
    heights = [_height(body) / _height(seen) for body, seen in views if not _is_cut(body, seen)]
    times = float(np.median(heights)) if 2 * len(heights) > len(somebody) else 1.0
    if not SMALL < times < LARGE:
        hint = (
            "is it the scan of this person, are cameras and first pose in metres, and is the matrix of each camera\n"
            "that of pictures of this size?"
        )
        yield warning(f"at the first pose the body is {times:.1f} times as tall as who is seen", hint, folder)
    else:
        yield from _nobody_there(bodies, somebody, folder)


def _is_cut(body: Bool, seen: Bool) -> bool:
    """Return whether a picture ends within a body, or what is seen goes through from top to bottom, as a light does."""
    return bool(body[[0, -1]].any() or seen[[0, -1]].any(axis=1).all())


def _height(mask: Bool) -> int:
    """Return from which to which row, in px, a mask (H, W) that is not empty reaches."""
    rows = np.flatnonzero(mask.any(axis=1))
    return int(rows[-1] - rows[0]) + 1


def _largest(mask: Bool) -> Bool:
    """Return the largest connected part of a mask (H, W) that is not empty."""
    import cv2

    _, part, statistics, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8))
    return np.asarray(part == 1 + statistics[1:, cv2.CC_STAT_AREA].argmax())


def _nobody_there(bodies: Mapping[str, Bool], somebody: Mapping[str, Bool], folder: Path) -> Iterator[Finding]:
    """Yield in which views, by the names of their cameras, nobody is where the body (H, W) at the first pose is."""
    shares = {name: seen[bodies[name]].mean() for name, seen in somebody.items() if bodies[name].any()}
    odd = [name for name, share in shares.items() if share < COVERED]
    if len(odd) > len(shares) / 2:
        hint = "is it the pose of frame 0, in metres, in the world of the calibration?"
        yield warning("nobody stands where the first pose says", hint, folder / first_pose.FILE)
    elif odd:
        hint = (
            "are calibration and video its own, were two cameras exchanged, does the clean plate show somebody, or is\n"
            "the first pose off? the other views agree"
        )
        yield warning(f"nobody stands where the first pose says in {', '.join(odd)}", hint, folder)


def _bodies(recording: Recording, registry: Registry) -> list[Bool] | None:
    """Return the silhouette (H, W) of the scanned body at the first pose in every view; None without one of them."""
    if not (recording.folder / first_pose.FILE).exists():
        return None
    try:
        scanned: Any = registry.get("body", "scanned")
        scene = Scene(cameras=recording.cameras, body=body_of(scanned(), recording.folder))
        surface = scene.surface(first_pose.read_pose(recording.folder / first_pose.FILE, scene.body), NO_CLOTH)
    except MocapflowError:
        return None
    return [covered(surface, camera) for camera in recording.cameras]
