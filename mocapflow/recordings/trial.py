"""What is odd about the cameras and videos of one folder, all pictures of which are looked through."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from filecmp import cmp
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from mocapflow.assets import Camera
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.cameras.rigs import examine_rig
from mocapflow.io.cameras.views import View
from mocapflow.io.findings import Finding, attempt, note, warning
from mocapflow.io.recording import layout
from mocapflow.io.recording.occluders import occluder
from mocapflow.io.recording.plates import background
from mocapflow.io.video import consistency
from mocapflow.io.video.frame_rate import common_rate
from mocapflow.io.video.frames import decoded
from mocapflow.io.video.images import name_frames
from mocapflow.io.video.lateness import late_frames
from mocapflow.io.video.reading import Video, count_from_first, open_video, read_frames
from mocapflow.recordings.freezing import difference, frozen_from
from mocapflow.records import F64


def examine_trial(folder: Path, calibration: Path, rig: bool = True) -> list[Finding]:
    """Return what is odd about cameras, their delays, videos, keypoints and clean plates of one folder.

    Args:
        folder: the recording, or the standing trial in it.
        calibration: its calibration file.
        rig: examine how the cameras stand, too.
    """
    findings: list[Finding] = []
    cameras = attempt(lambda: read_cameras(calibration), findings)
    if cameras is None:
        return findings
    late = attempt(lambda: late_frames(folder, [c.name for c in cameras]), findings)
    videos = _opened(folder, cameras, calibration, findings)
    if videos is None:
        return findings + (_examine_rig(cameras) if rig else [])
    lenses, length = _agreed(folder, cameras, videos, calibration, findings)
    findings += _examine_rig(cameras if lenses is None else lenses) if rig else []
    findings += [*copies(cameras, videos), *_looked_through(cameras, videos, length)]
    if late is not None:
        delayed = [replace(video, late=frames) for video, frames in zip(videos, late, strict=True)]
        attempt(lambda: consistency.check_lateness(cameras, delayed, length, folder), findings)
    _examine_keypoints(folder, cameras, length, videos[0].first, findings)
    unused = attempt(lambda: layout.unused_pictures(folder, cameras), findings)
    if unused is not None:
        findings += [warning(text, where=folder) for text in unused]
        if lenses is not None:
            _examine_pictures(folder, lenses, videos, findings)
    return findings


def _examine_rig(cameras: Sequence[Camera]) -> list[Finding]:
    """Return how cameras stand; nothing where a size is not known."""
    return list(examine_rig(cameras)) if all(camera.size.all() for camera in cameras) else []


def _opened(
    folder: Path, cameras: Sequence[Camera], calibration: Path, findings: list[Finding]
) -> tuple[Video, ...] | None:
    """Return the video of each camera; None where one is missing or can't be opened."""
    paths = attempt(lambda: layout.match_videos(folder, [c.name for c in cameras], calibration), findings)
    tried = [attempt(partial(open_video, path), findings) for path in paths or ()]
    videos = [video for video in tried if video is not None]
    return count_from_first(videos) if len(videos) == len(cameras) else None


def _agreed(
    folder: Path, cameras: Sequence[Camera], videos: Sequence[Video], calibration: Path, findings: list[Finding]
) -> tuple[Sequence[Camera] | None, int]:
    """Return the cameras with the size of their videos, None where that is another, and how many frames all have."""
    fitted = attempt(lambda: consistency.fit_sizes(cameras, videos, calibration), findings)
    agreed = attempt(lambda: consistency.agree_on_length(cameras, videos, folder), findings)
    rate = attempt(lambda: common_rate(cameras, videos, calibration), findings)
    findings += [warning(text, where=folder) for part in (fitted, agreed, rate) if part is not None for text in part[1]]
    findings += [note(text, where=folder) for text in consistency.first_warnings(videos)]
    length = min(video.frames for video in videos) if agreed is None else agreed[0]
    return None if fitted is None else fitted[0], length


def _examine_keypoints(
    folder: Path, cameras: Sequence[Camera], length: int, image: int, findings: list[Finding]
) -> None:
    """Add what is odd about keypoints, for images from a number on."""
    odd = attempt(lambda: layout.keypoint_warnings(folder, cameras, length, image), findings)
    if odd is not None:
        findings += [warning(text, where=folder) for text in odd]
        findings += [note(text, where=folder) for text in layout.keypoint_numbers(folder, cameras, length, image)]


def _examine_pictures(folder: Path, lenses: Sequence[Camera], videos: Sequence[Video], findings: list[Finding]) -> None:
    """Add what is odd about occluders and clean plates."""
    views = [View(lens=lens, occluder=attempt(partial(occluder, folder, lens), findings)) for lens in lenses]
    for view in views:
        if view.occluder is not None:
            share = f"{view.occluder.mean():.0%} of its pictures are behind occluders"
            findings.append(note(f"{view.lens.name}: {share}", where=folder))
    attempt(lambda: background(folder, views, lambda: next(decoded(views, videos, range(1), 1.0))), findings)


def copies(cameras: Sequence[Camera], videos: Sequence[Video]) -> Iterator[Finding]:
    """Yield which cameras have one and the same file."""
    for (a, one), (b, other) in combinations(zip([c.name for c in cameras], videos, strict=True), 2):
        if cmp(one.path, other.path, shallow=False):  # folders of images are never alike to it
            hint = "one of them is a copy by mistake: copy it again from its own camera"
            yield warning(f"{a} and {b} have the same video", hint, other.path)


def _looked_through(cameras: Sequence[Camera], videos: Sequence[Video], length: int) -> Iterator[Finding]:
    """Yield which frames of the videos can't be used, and which cameras hang."""
    change = np.full((length, len(videos)), np.nan)
    for column, camera, video in zip(change.T, cameras, videos, strict=True):
        lost, found = look_through(video)
        column[:] = found[:length]
        lost = [index for index in lost if index < video.frames]
        absent = [] if video.path.is_dir() else sorted({*lost} - {*video.numbers.tolist()})
        if absent:
            hint = "the view is not used in these frames; was it converted, or filmed at an automatic frame rate?"
            what = f"{camera.name}: {name_frames(absent)} missing in the video: its time stamps jump"
            yield warning(what, hint, video.path)
        if lost := [index for index in lost if index not in absent]:
            why = "missing, damaged or of another size" if video.path.is_dir() else "can't be decoded"
            hint = "the view is not used in these frames, some perhaps made from damaged ones; others keep their places"
            yield warning(f"{camera.name}: {name_frames(lost)} {why}", hint, video.path)
    for since, camera, video in zip(frozen_from(change), cameras, videos, strict=True):
        if since < length:
            when = f"repeats one picture from frame {since} on" if since else "shows one picture from first to last"
            left = ", or does nobody come into its view any more" if since else ""
            hint = f"did the camera hang{left}? the stage check_views goes without such pictures"
            yield warning(f"{camera.name} {when}, the others move", hint, video.path)


def look_through(video: Video) -> tuple[list[int], F64]:
    """Return which of the frames that there should be are lost, and by how much each of all differs from the last one.

    The latter (N,) is in grey levels, NaN without a picture or one before it.
    """
    lost, change, before = [], np.full(video.declared, np.nan), None
    for index, (image, _) in enumerate(read_frames(video, range(video.declared))):
        if image is None:
            lost.append(index)
            continue
        if before is not None:
            change[index] = difference(image, before)
        before = image
    return lost, change
